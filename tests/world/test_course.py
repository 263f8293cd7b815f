"""An arm through a run of frames beside boxes: free, calm, and on the side from which it came."""

import numpy as np
import pytest

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.skeleton.dofs import body_skeleton
from mhvedit.skeleton.model import Skeleton
from mhvedit.world.course import Moment, Yielding, calm, freed, freed_run
from mhvedit.world.depth import TOLERANCE
from mhvedit.world.figure import Figure
from mhvedit.world.pieces import box, capsule
from mhvedit.world.surroundings import Frames, Surroundings
from tests.world.things import fixed

RADIUS, MARGIN = 0.03, 0.001  # m
LENGTH = 0.3  # m, of each of two bones along x
N = 40


def arm() -> Skeleton:
    offsets = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])
    turning = {"b": ["y"], "c": ["y"]}
    return body_skeleton(("a", "b", "c"), np.array([-1, 0, 1]), offsets, turning=turning, sliding=["a"])


def figure(skeleton: Skeleton) -> Figure:
    bones = (capsule(np.zeros(3), np.array([LENGTH, 0.0, 0.0]), RADIUS),) * 2
    nothing = np.zeros((2, 2), np.bool_)
    effort = np.ones(skeleton.n_dofs)
    return Figure(skeleton, bones, np.array([1, 2]), np.full(3, -1), nothing, effort, (), "human")


def moments(tracked: FloatArray, low: float, high: float) -> list[Moment]:
    """The arm over or in a slab between two heights."""
    body = fixed("slab", [box(np.array([0.2, -1.0, low]), np.array([1.0, 1.0, high]))])
    frames = Frames(np.eye(3)[None], body.centre[None])
    return [Moment(q, Surroundings(figure(arm()), [body]), frames, MARGIN) for q in tracked]


def dipping(deepest: float) -> FloatArray:
    """(N, D) the shoulder turns down and up again in the middle of the run."""
    skeleton = arm()
    q = np.zeros((N, skeleton.n_dofs))
    angle = np.where(np.abs(np.arange(N) - N / 2) < 10, np.cos((np.arange(N) - N / 2) * np.pi / 20), 0.0)
    q[:, skeleton.dof_names.index("b.y")] = deepest * np.maximum(angle, 0.0)
    return q


def free_dofs() -> BoolArray:
    return np.asarray(arm().dof_joint > 0)


def deepest(moment: Moment, q: FloatArray) -> float:
    return moment.surroundings.look(q, moment.frames, reach=0.0).gaps.deepest


@pytest.mark.parametrize("thick", [1.0, 0.03])
def test_an_arm_that_dips_into_a_slab_stays_on_it(thick: float) -> None:
    tracked = dipping(0.5)
    run = moments(tracked, -0.1 - thick, -0.1)
    q = freed_run(run, Yielding(free_dofs(), begins=True, ends=True))
    assert max(deepest(moment, own) for moment, own in zip(run, tracked, strict=True)) > min(thick / 2, 0.05)
    assert max(deepest(moment, own) for moment, own in zip(run, q, strict=True)) <= TOLERANCE
    changes = q - tracked
    assert np.abs(changes[[0, -1]]).max() < 1e-3, "the run joins what is around it"
    assert (changes[:, ~free_dofs()] == 0).all(), "who stands keeps standing"
    assert np.abs(np.diff(q, axis=0)).max() < 1.5 * np.abs(np.diff(tracked, axis=0)).max()
    at_rest = N // 2
    gap = run[at_rest].surroundings.look(q[at_rest], run[at_rest].frames, reach=0.1).gaps.distance.min()
    assert gap == pytest.approx(MARGIN, abs=1e-3), "it lies on the slab where it was deepest"


def test_what_touches_nothing_is_left_as_it_is() -> None:
    tracked = dipping(0.1)
    run = moments(tracked, -1.2, -0.2)
    np.testing.assert_array_equal(freed_run(run, Yielding(free_dofs(), begins=True, ends=True)), tracked)


def test_a_run_that_begins_inside_is_freed_from_its_other_end() -> None:
    tracked = dipping(0.5)[N // 2 :]
    run = moments(tracked, -0.13, -0.1)
    q = freed_run(run, Yielding(free_dofs(), begins=False, ends=True))
    assert max(deepest(moment, own) for moment, own in zip(run, q, strict=True)) <= TOLERANCE
    ends = [moment.surroundings.look(own, moment.frames, reach=1.0) for moment, own in zip(run, q, strict=True)]
    assert all(seen.gaps.normal[:, 2].max() < -0.9 for seen in ends), "above the slab, from where it leaves"


def test_a_free_posture_is_its_own_answer() -> None:
    [moment] = moments(dipping(0.0)[:1], -1.0, -0.5)
    np.testing.assert_array_equal(freed(moment, moment.tracked, free_dofs(), start=moment.tracked), moment.tracked)


def test_calm_changes_keep_what_was_asked_and_come_from_nothing() -> None:
    changes = np.zeros((31, 1))
    changes[12:19] = 1.0
    found = calm(changes, changes[:, 0] > 0, Yielding(np.ones(1, np.bool_), begins=True, ends=True))
    np.testing.assert_allclose(found[12:19, 0], 1.0, atol=0.05)
    assert np.abs(found[[0, -1]]).max() < 0.05
    assert np.abs(np.diff(found, axis=0)).max() < 0.6 < np.abs(np.diff(changes, axis=0)).max()
    assert found.min() > -0.02, "it does not swing over"
    np.testing.assert_allclose(found, found[::-1], atol=1e-9)
