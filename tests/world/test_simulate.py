"""The loop over frames (C1.2, C1.3), and what it says of bad input."""

import numpy as np
import pytest

from mhvedit.errors import ShapeError
from mhvedit.world.avatar_scenes import posture
from mhvedit.world.bodies import FARTHEST
from mhvedit.world.coupling import Coupling
from mhvedit.world.figure import load_avatar
from mhvedit.world.pieces import box, sphere
from mhvedit.world.problems import WorldError
from mhvedit.world.simulate import Simulation
from mhvedit.world.world import Tracked, World, pose_of, start
from tests.world.things import FPS, GAP, MATERIALS, at, ball, cube, driven, fixed, floor, played, simulated

WALL = [box(np.array([0.0, -2, -2]), np.array([0.3, 2, 2]))]
NO_GRAVITY = (0.0, 0.0, 0.0)


def test_c1_3_a_driven_body_stops_at_a_fixed_one() -> None:
    world = World((fixed("wall", WALL), driven("hand", [cube(0.05)])), MATERIALS, gravity=NO_GRAVITY)
    tracked = [Tracked({"hand": at(-0.5 + 0.01 * k, 0.3, 0)}) for k in range(80)]
    states, reports = played(world, {"wall": at(0, 0, 0), "hand": at(-0.5, 0.3, 0)}, 80 / FPS, tracked=tracked)
    x = [pose_of(world, state, "hand").position for state in states]
    assert x[-1] == pytest.approx([-0.05, 0.3, 0], abs=1e-3)
    assert max(report.deepest for report in reports) < 1e-3


def test_c4_1_a_driven_body_follows_its_tracker_through_the_coupling() -> None:
    world = World((driven("hand", [cube(0.05)]),), MATERIALS, coupling=Coupling(1000.0, 40.0))
    tracked = [Tracked({"hand": at(1, 0, 0)})] * 30
    states, _ = played(world, {"hand": at(1, 0, 0)}, 0.5, tracked=tracked)
    assert pose_of(world, states[-1], "hand").position == pytest.approx([1, 0, 0])
    step = [Tracked({"hand": at(1.1, 0, 0)})] * 30
    states, _ = played(world, {"hand": at(1, 0, 0)}, 0.5, tracked=step)
    assert pose_of(world, states[-1], "hand").position == pytest.approx([1.1, 0, 0], abs=1e-4)


def test_a_driven_body_pushes_a_simulated_one() -> None:
    world = World((floor(), ball(mass=0.3), driven("hand", [cube(0.05)])), MATERIALS)
    tracked = [Tracked({"hand": at(-0.4 + 0.02 * k, 0, 0.1)}) for k in range(60)]
    poses = {"floor": at(0, 0, 0), "ball": at(0, 0, 0.1 + GAP), "hand": at(-0.4, 0, 0.1)}
    states, reports = played(world, poses, 1.0, tracked=tracked)
    assert pose_of(world, states[-1], "ball").position[0] > 0.5
    assert max(report.deepest for report in reports) < 1e-3


def test_c1_3_a_ball_between_wall_and_hand_stops_the_hand() -> None:
    world = World((fixed("wall", WALL), ball(mass=0.3), driven("hand", [cube(0.05)])), MATERIALS, gravity=NO_GRAVITY)
    tracked = [Tracked({"hand": at(-0.6 + 0.01 * k, 0, 0)}) for k in range(90)]
    poses = {"wall": at(0, 0, 0), "ball": at(-0.2, 0, 0), "hand": at(-0.6, 0, 0)}
    states, reports = played(world, poses, 1.5, tracked=tracked)
    assert max(report.deepest for report in reports) < 1e-3
    assert not any(report.stuck for report in reports)
    assert pose_of(world, states[-1], "ball").position[0] <= -0.0995


def test_a_figure_pushes_a_ball() -> None:
    avatar = load_avatar()
    world = World((ball(mass=0.3),), MATERIALS, avatar, gravity=NO_GRAVITY)
    ahead = {"left_upper_arm.z": -85.0, "right_upper_arm.z": 85.0}
    tracked = [Tracked(posture=posture(avatar.skeleton, {**ahead, "pelvis.ty": -0.01 * k})) for k in range(60)]
    states, reports = played(world, {"ball": at(0.18, -1.0, 1.42)}, 1.0, tracked=tracked)
    assert pose_of(world, states[-1], "ball").position[1] < -1.2
    assert max(report.deepest for report in reports) < 1e-3


def test_simulated_bodies_that_start_inside_each_other_are_parted() -> None:
    world = World((floor(), simulated("box", [cube(0.1)])), MATERIALS)
    states, reports = played(world, {"floor": at(0, 0, 0), "box": at(0, 0, 0.02)}, 0.5)
    assert reports[-1].deepest < 1e-3
    assert pose_of(world, states[-1], "box").position[2] == pytest.approx(0.1, abs=1e-3)


def test_order_of_bodies_and_a_second_run_change_nothing() -> None:
    bodies = [floor(), *(ball(f"ball{i}", 0.05 + 0.01 * i, 0.2 + i) for i in range(3))]
    poses = {"floor": at(0, 0, 0)} | {f"ball{i}": at(0.02 * i, 0.01 * i, 0.2 + 0.2 * i) for i in range(3)}
    runs = []
    for order in (bodies, bodies, bodies[::-1]):
        world = World(tuple(order), MATERIALS)
        states, _ = played(world, poses, 0.7)
        runs.append({name: pose_of(world, states[-1], name).position for name in poses})
    for name in poses:
        assert (runs[0][name] == runs[1][name]).all() and (runs[0][name] == runs[2][name]).all()


def test_a_body_that_leaves_the_world_is_held_at_its_end_and_named() -> None:
    world = World((ball(),), MATERIALS, gravity=NO_GRAVITY)
    velocity = {"ball": np.array([0.0, 0.0, -600.0])}
    states, reports = played(world, {"ball": at(0, 0, -0.995 * FARTHEST)}, 1.0, velocities=velocity)
    assert reports[0].lost == () and reports[-1].lost == ("ball",)
    assert np.abs(states[-1].moving.positions).max() <= FARTHEST


@pytest.mark.parametrize("time", [0.0, -0.1, 1.5, float("nan"), float("inf")])
def test_time_steps_that_cannot_be(time: float) -> None:
    world = World((ball(),), MATERIALS)
    with pytest.raises(WorldError, match="time step: expected above 0 and at most 1 s"):
        Simulation(world).step(start(world, {"ball": at(0, 0, 0)}), Tracked(), time)


def test_worlds_that_cannot_be() -> None:
    with pytest.raises(WorldError, match="ball twice"):
        World((ball(), ball()), MATERIALS)
    world = World((ball(), driven("hand", [sphere(0.1)])), MATERIALS)
    with pytest.raises(WorldError, match="pose of hand: expected a pose of every body, found none"):
        start(world, {"ball": at(0, 0, 0)})
    with pytest.raises(WorldError, match="found fist"):
        start(world, {"ball": at(0, 0, 0), "hand": at(1, 0, 0), "fist": at(0, 0, 0)})
    state, simulation = start(world, {"ball": at(0, 0, 0), "hand": at(1, 0, 0)}), Simulation(world)
    with pytest.raises(WorldError, match=r"one of the driven bodies \(hand\), found ball"):
        simulation.step(state, Tracked({"ball": at(0, 0, 0)}), 0.1)
    with pytest.raises(WorldError, match="as the world has no figure"):
        simulation.step(state, Tracked(posture=np.zeros(3)), 0.1)
    with_figure = World((), MATERIALS, load_avatar())
    with pytest.raises(WorldError, match="a tracked posture of the figure"):
        Simulation(with_figure).step(start(with_figure, {}), Tracked(), 0.1)


def test_moving_arrays_belong_together() -> None:
    state = start(World((ball(),), MATERIALS), {"ball": at(0, 0, 0)})
    with pytest.raises(ShapeError, match="velocity"):
        type(state.moving)(
            state.moving.rotations, state.moving.positions, np.zeros((2, 3)), state.moving.momentum, state.moving.spin,
            state.moving.inverse_mass, state.moving.inverse_inertia,
        )  # fmt: skip
