"""The paper's four scenes of an avatar leave no overlap above 1 mm (C5, C7), and what cannot be freed says why."""

from dataclasses import replace

import numpy as np
import pytest

from mhvedit.avoidance.posture import place
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.avatar_scenes import AVATAR_SCENES, WorldScene, avatar_scene, posture
from mhvedit.world.cones import leaves_cone
from mhvedit.world.figure import Figure, capsule_figure, load_avatar
from mhvedit.world.hand_scenes import HAND_SCENES, hand_scene
from mhvedit.world.pieces import box
from mhvedit.world.problems import WorldError
from mhvedit.world.resolve import CHEAPEST_FIRST, PAPER, Before, ResolveSettings, Stage, resolve, stage_counts
from mhvedit.world.simulate import FrameReport, Simulation, run
from mhvedit.world.surroundings import Frames, PieceGaps, Surroundings
from mhvedit.world.world import State, Tracked, World, start
from tests.world.independent import deepest, judge_of
from tests.world.things import MATERIALS, fixed

MOST = 1e-3  # m
AVATAR = load_avatar()
REST = posture(AVATAR.skeleton, {"left_upper_arm.y": 75.0, "right_upper_arm.y": -75.0})
AHEAD = posture(AVATAR.skeleton, {"left_upper_arm.z": -85.0, "right_upper_arm.z": 85.0})


def simulate(scene: WorldScene, settings: ResolveSettings | None = None) -> tuple[list[State], list[FrameReport]]:
    state = start(scene.world, scene.poses)
    return run(Simulation(scene.world, settings=settings), state, scene.tracked, fps=scene.fps)


@pytest.mark.parametrize("name", AVATAR_SCENES)
def test_no_frame_of_the_papers_scenes_overlaps(name: str) -> None:
    scene = avatar_scene(name)
    states, reports = simulate(scene)
    judge = judge_of(scene.world)
    assert max(deepest(judge, state) for state in states) < MOST
    assert all(report.resolved is not None and report.resolved.free and not report.stuck for report in reports)
    before = start(scene.world, scene.poses)
    tracked = [_placed(AVATAR, before, frame) for frame in scene.tracked[::10]]
    assert sum(deepest(judge, state) > 0.02 for state in tracked) > 10, "the tracked motion runs through something"


@pytest.mark.parametrize("name", AVATAR_SCENES)
def test_postures_move_no_faster_than_twice_the_tracker_and_stay_in_their_limits(name: str) -> None:
    scene = avatar_scene(name, n_frames=300)
    _, reports = simulate(scene)
    q = np.array([report.resolved.q for report in reports if report.resolved])
    tracked = np.array([frame.posture for frame in scene.tracked])
    assert np.abs(np.diff(q, axis=0)).max() < 2.5 * np.abs(np.diff(tracked, axis=0)).max()
    skeleton = AVATAR.skeleton
    low, high = np.minimum(skeleton.limits[:, 0], tracked), np.maximum(skeleton.limits[:, 1], tracked)
    assert ((q >= low - 1e-9) & (q <= high + 1e-9)).all()
    assert not any(leaves_cone(skeleton, place(skeleton, each).rotations, AVATAR.cones) for each in q[::5])


@pytest.mark.parametrize("name", HAND_SCENES)
def test_no_frame_of_the_hands_scenes_overlaps(name: str) -> None:
    scene = hand_scene(name, n_frames=300)
    states, reports = simulate(scene)
    judge = judge_of(scene.world)
    assert max(deepest(judge, state) for state in states) < MOST
    assert not any(report.stuck for report in reports)
    ball = [body.name for body in scene.world.bodies].index("ball")
    heights = np.array([state.moving.positions[ball, 2] for state in states])
    assert heights[0] == pytest.approx(0.78, abs=1e-3)
    assert (heights[-1] < 0.1) == (name == "hand on table"), "the ball is snipped off the table"


def test_descent_alone_does_not_converge_and_least_squares_adds_to_it() -> None:
    scene = avatar_scene("arm in corner", n_frames=200)
    counts = {}
    for label, stages in (("ccd", PAPER.stages), ("both", CHEAPEST_FIRST.stages)):
        _, reports = simulate(scene, ResolveSettings(stages))
        counts[label] = stage_counts([report.resolved for report in reports if report.resolved])
        assert counts[label][Stage.STUCK] == 0
    assert counts["ccd"][Stage.BACK] > 100 > counts["both"][Stage.BACK]
    assert counts["both"][Stage.LEAST_SQUARES] > 10


def test_the_same_seed_gives_the_same_and_order_of_bodies_is_nothing() -> None:
    scene = avatar_scene("self-collision", n_frames=120)
    turned = replace(scene, world=World(scene.world.bodies[::-1], scene.world.materials, scene.world.figure))
    first, again, other = (
        [report.resolved.q for report in simulate(each, CHEAPEST_FIRST)[1] if report.resolved]
        for each in (scene, scene, turned)
    )
    assert (np.array(first) == np.array(again)).all()
    assert (np.array(first) == np.array(other)).all()


def test_gap_rows_against_finite_differences() -> None:
    wall = fixed("wall", [box(np.array([-1.0, -0.9, 0]), np.array([1.0, -0.72, 2]))])
    constraint = PieceGaps(Surroundings(AVATAR, [wall]), _frames(wall), 1e-3, 0.05)
    rows = constraint.rows(place(AVATAR.skeleton, AHEAD))
    assert len(rows.low) > 2
    for dof in range(AVATAR.skeleton.n_dofs):
        step = np.zeros(len(AHEAD))
        step[dof] = 1e-5
        ahead, behind = (constraint.rows(place(AVATAR.skeleton, AHEAD + s * step)) for s in (1, -1))
        assert -(ahead.low - behind.low) / 2e-5 == pytest.approx(rows.jacobian[:, dof], abs=2e-3)


def test_a_start_in_deep_overlap_is_freed() -> None:
    wall = fixed("wall", [box(np.array([-2.0, -2.0, 0]), np.array([2.0, -0.5, 3]))])
    found = resolve(Surroundings(AVATAR, [wall]), AHEAD, _frames(wall))
    assert found.free and found.stage is not Stage.FREE


def test_arms_that_start_behind_a_wall_are_said_to_be_stuck_or_are_free() -> None:
    wall = fixed("wall", [box(np.array([-2.0, -0.6, 0]), np.array([2.0, -0.35, 3]))])
    found = resolve(Surroundings(AVATAR, [wall]), AHEAD, _frames(wall))
    assert found.free == (found.deepest <= 5e-4) and found.free == (not found.reason)


def test_nowhere_to_go_is_stuck_with_a_reason() -> None:
    block = fixed("block", [box(np.full(3, -9.0), np.full(3, 9.0))])
    found = resolve(Surroundings(AVATAR, [block]), REST, _frames(block))
    assert not found.free and found.stage is Stage.STUCK
    assert "mm inside" in found.reason and "no free posture came before" in found.reason
    before = Before(REST, REST, True)
    assert (
        "has moved into the last free posture"
        in resolve(Surroundings(AVATAR, [block]), REST, _frames(block), before=before).reason
    )


def test_a_tracker_without_numbers_holds_the_last_posture() -> None:
    world = World((), MATERIALS, AVATAR)
    broken = REST.copy()
    broken[7] = np.nan
    simulation, state = Simulation(world), start(world, {})
    with pytest.raises(WorldError, match="of the first tracked posture: expected a finite number"):
        simulation.step(state, Tracked(posture=broken), 1 / 60)
    state, _ = simulation.step(state, Tracked(posture=REST), 1 / 60)
    state, report = simulation.step(state, Tracked(posture=broken), 1 / 60)
    assert report.resolved is not None and (report.resolved.q == REST).all()
    assert "the tracker gives no number for" in report.resolved.reason
    state, report = simulation.step(state, Tracked(posture=AHEAD), 1 / 60)
    assert report.resolved is not None and (report.resolved.q == AHEAD).all()


@pytest.mark.parametrize("metres", [0.7, 3.0, 50.0])
def test_a_tracker_that_jumps_leaves_no_overlap(metres: float) -> None:
    scene = avatar_scene("two arms", n_frames=60)
    jumps = [
        Tracked(posture=frame.posture + metres * (k % 2) * _slide())
        for k, frame in enumerate(scene.tracked)
        if frame.posture is not None
    ]
    states, reports = simulate(replace(scene, tracked=tuple(jumps)))
    judge = judge_of(scene.world)
    free = [report.resolved is not None and report.resolved.free for report in reports]
    assert all(deepest(judge, state) < MOST for state, ok in zip(states, free, strict=True) if ok)
    assert sum(free) >= 58


def test_postures_of_another_skeleton() -> None:
    with pytest.raises(ShapeError, match="tracked"):
        resolve(Surroundings(AVATAR, []), np.zeros(3), Frames(np.zeros((0, 3, 3)), np.zeros((0, 3))))


def test_a_figure_of_any_skeleton_with_bones() -> None:
    figure = capsule_figure(AVATAR.skeleton, cones=False)
    assert len(figure.pieces) == len(AVATAR.pieces) and figure.cones == ()
    assert (figure.self_pairs == figure.self_pairs.T).all() and not figure.self_pairs.diagonal().any()
    with pytest.raises(ShapeError, match="effort"):
        replace(figure, effort=np.zeros(2))


def _frames(*bodies) -> Frames:  # type: ignore[no-untyped-def]  # noqa: ANN002
    return Frames(np.repeat(np.eye(3)[None], len(bodies), axis=0), np.array([body.centre for body in bodies]))


def _slide() -> FloatArray:
    return np.array([name == "pelvis.tx" for name in AVATAR.skeleton.dof_names], np.float64)


def _placed(figure: Figure, state: State, tracked: Tracked) -> State:
    """A state with the figure as tracked."""
    assert tracked.posture is not None
    placed, n = place(figure.skeleton, tracked.posture), len(state.tracked)
    rotations, positions = state.moving.rotations.copy(), state.moving.positions.copy()
    rotations[n:], positions[n:] = placed.rotations, placed.positions
    return replace(state, moving=replace(state.moving, rotations=rotations, positions=positions))
