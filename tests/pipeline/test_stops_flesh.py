"""Which limbs give way to a prop, and what they are made of."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from mhvedit.fitting.deform import BoneFrames
from mhvedit.fitting.joints import NAMES, PARENTS, joint
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline import stops_actor, stops_stretch
from mhvedit.pipeline.assemble import Stop
from mhvedit.pipeline.stops_flesh import LIMBS, Flesh, fleshed, holder_of, limbs_at
from mhvedit.pipeline.stops_pass import stop_in_words
from mhvedit.scene.edit import SubjectEdit
from mhvedit.scene.shown import moved
from mhvedit.sequences.meshes import Mesh, joined
from mhvedit.skeleton.dofs import body_skeleton
from mhvedit.world.surroundings import Frames

ARM, LEG = LIMBS[0], LIMBS[2]  # left ones
HAND, FOREARM, FOOT = joint("left_hand"), joint("left_forearm"), joint("left_foot")
PLACES = {
    FOREARM: (0.3, 0.0, 1.2),
    HAND: (0.55, 0.0, 1.2),
    FOOT: (0.0, 0.1, 0.1),
    joint("right_hand"): (-0.5, 0.0, 1.2),
}  # m


def ball(middle: tuple[float, float, float], radius: float = 0.05) -> Mesh:
    mesh = trimesh.creation.icosphere(2, radius)
    return Mesh(np.asarray(mesh.vertices) + middle, np.asarray(mesh.faces, np.int32))


def places() -> FloatArray:
    found = np.zeros((len(NAMES), 3))
    for bone, place in PLACES.items():
        found[bone] = place
    return found


def person(*, foot: float = 0.05, things: dict[str, Mesh] | None = None) -> Flesh:
    """A hand and a foot, which are balls; the lowest of the foot is at a height of `foot` m."""
    parts = {HAND: ball((0.6, 0.0, 1.2)), FOOT: ball((0.0, 0.1, foot + 0.05))}
    weights = np.concatenate([np.eye(len(NAMES))[[bone] * len(mesh.vertices)] for bone, mesh in parts.items()])
    return Flesh(joined(list(parts.values())), weights, things or {}, dict.fromkeys(things or {}, HAND))


def shot(flesh: Flesh) -> stops_actor.Shot:
    return stops_actor.Shot(0, 0, np.zeros(0), flesh, Frames(np.zeros((0, 3, 3)), np.zeros((0, 3))))


def actor_among(*others: Mesh) -> stops_actor.Actor:
    edit = SubjectEdit(np.zeros(1, np.int64), np.zeros((1, 3)))
    return stops_actor.Actor(edit, None, {}, {}, None, None, {}, {}, lambda frame: list(others))  # type: ignore[arg-type]


def chosen(flesh: Flesh, *others: Mesh) -> stops_actor.Choice:
    """The limbs of which something is in a prop: all of them."""
    actor = actor_among(*others)
    look = stops_actor.Look({"wall": 0.02}, np.ones(len(flesh.body.vertices), np.bool_), {})
    return stops_actor.chosen(actor, [shot(flesh)], [(shot(flesh), look)])


def test_a_standing_leg_stays_and_a_lifted_one_gives_way() -> None:
    assert chosen(person(foot=0.03)) == stops_actor.Choice((ARM,), ("the left leg stands",))
    assert chosen(person(foot=0.2)) == stops_actor.Choice((ARM, LEG))


@pytest.mark.parametrize(("gap", "moves"), [(0.004, False), (-0.01, False), (0.03, True)])
def test_a_limb_in_contact_with_somebody_else_stays(gap: float, moves: bool) -> None:
    other = ball((0.7 + gap, 0.0, 1.2))
    found = chosen(person(foot=0.2), other)
    assert (ARM in found.limbs) == moves and LEG in found.limbs
    assert moves or found.why == ("the left arm is in contact with somebody else",)


def test_what_is_held_counts_as_the_limb() -> None:
    blade = ball((0.9, 0.0, 1.2))
    held = person(things={"sword": blade})
    assert limbs_at(held, np.zeros(len(held.body.vertices), np.bool_), {"sword": blade.vertices[:, 0] > 0.93}) == [ARM]
    touching = chosen(replace(held), ball((1.005, 0.0, 1.2)))
    assert ARM not in touching.limbs


def test_the_hand_that_is_nearest_holds() -> None:
    at = np.array([places()] * 2)
    assert holder_of([ball((0.6, 0.1, 1.2))] * 2, at) == HAND
    assert holder_of([ball((-0.5, 0.1, 1.2))] * 2, at) == joint("right_hand")
    assert holder_of([ball((0.6, 0.1, 1.2)), ball((0.0, 1.0, 0.2))], at) is None


def test_flesh_is_the_hull_of_what_a_bone_carries_in_slices() -> None:
    skeleton = body_skeleton(NAMES, PARENTS, np.zeros((len(NAMES), 3)), turning=dict.fromkeys(NAMES), sliding=NAMES[:1])
    held = person(things={"sword": ball((0.9, 0.0, 1.2), 0.2)})
    turns = np.tile(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), (len(NAMES), 1, 1))
    made = fleshed(skeleton, held, (ARM,), (turns, places()))
    assert set(made.joint.tolist()) == {HAND} and len(made.pieces) > 5
    corners = np.concatenate([piece.points for piece in made.pieces]) @ turns[HAND].T + places()[HAND]
    assert corners[:, 0].max() == pytest.approx(1.1, abs=0.01) and corners[:, 0].min() == pytest.approx(0.55, abs=0.01)
    assert not made.self_pairs.any()


def test_windows_join_what_is_near_and_stay_in_the_scene() -> None:
    depth = np.zeros(100)
    depth[[5, 30, 45]] = 0.01
    assert stops_stretch.windows_of({"wall": depth, "table": np.zeros(100)}, 100) == [range(16), range(20, 56)]
    assert stops_stretch.windows_of({"wall": np.full(3, 0.002)}, 3) == []


def test_what_is_left_is_what_is_left_of_the_limbs() -> None:
    flesh = person()
    hand = flesh.of_limb(ARM)
    assert stops_actor.left_of(stops_actor.Look({"wall": 0.02, "table": 0.0}, hand, {}), flesh, (ARM,)) == 0.02
    assert stops_actor.left_of(stops_actor.Look({"wall": 0.02, "table": 0.0}, ~hand, {}), flesh, (ARM,)) == 0.0


def test_what_is_held_moves_rigidly_with_its_hand() -> None:
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turns = np.tile(np.eye(3), (len(NAMES), 1, 1))
    before = BoneFrames(turns, places())
    after = BoneFrames(np.tile(quarter, (len(NAMES), 1, 1)), places() + np.array([0.0, 0.0, 0.1]))
    tip = np.array([[0.95, 0.0, 1.2]])  # 0.4 m from the wrist
    np.testing.assert_allclose(moved(stops_stretch._move(before, after, HAND), tip), [[0.55, 0.4, 1.3]], atol=1e-12)
    np.testing.assert_allclose(moved(stops_stretch._move(before, before, HAND), tip), tip, atol=1e-12)


def test_joints_are_told_against_those_above_them() -> None:
    turns = Rotation.from_rotvec([[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]).as_matrix()[None]
    bend = Rotation.from_rotvec([0.0, 0.4, 0.0]).as_matrix()
    after = turns.copy()
    after[0, 1:] = bend @ turns[0, 1:]  # the second turns, and takes the third along
    np.testing.assert_allclose(stops_stretch._turned(np.array([-1, 0, 1]), turns, after), [[0, 0.4, 0]], atol=1e-7)


def test_limbs_that_would_run_into_somebody_else_stay() -> None:
    beside, inside = person(), person()
    moved_body = replace(inside.body, vertices=inside.body.vertices + np.array([0.1, 0.0, 0.0]))
    actor = actor_among(ball((0.78, 0.0, 1.2)))
    clear = stops_actor.Look({"wall": 0.0}, np.zeros(len(beside.body.vertices), np.bool_), {})
    for flesh, said in (
        (replace(inside, body=moved_body), "the left arm would run into somebody else"),
        (beside, None),
    ):
        found = stops_stretch._Outcome(np.ones((1, 1)), np.zeros((1, 1)), [flesh], [{}], [clear])
        seen = [(shot(beside), stops_actor.Look({"wall": 0.02}, beside.of_limb(ARM), {}))]
        assert stops_stretch._fault(actor, [replace(shot(beside), q=np.zeros(1))], seen, found, limbs=(ARM,)) == said


def test_a_run_is_told_in_a_sentence() -> None:
    stop = Stop("anna", "wall", 5, 23, 75.0, 0.2, ("left arm",), 14.2, "left_forearm", "")
    told = (
        "anna: left arm stopped at wall in frames 5 to 23, 75 mm deep as captured, 0 mm now; "
        "left_forearm turns by 14 degrees"
    )
    assert stop_in_words(stop) == told
    assert stop_in_words(replace(stop, why="the left leg stands")) == f"{told}. What is left: the left leg stands"
    stays = replace(stop, last=5, limbs=(), why="the left leg stands")
    assert stop_in_words(stays) == "anna stays 75 mm inside wall in frame 5: the left leg stands"
