"""The interaction dictionary on one contact voxel, where every type has a closed form (eqs 3 to 11)."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from mhvedit.constraints.clauses import Clause, Meeting
from mhvedit.constraints.dictionary import (
    MIRROR,
    NO_CONTACT,
    TEMPORAL,
    InteractionType,
    Slack,
    ending,
    ever,
    starting,
    temporal_clauses,
)
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.volumes.history import MotionHistoryVolume, intersection
from tests import oracles
from tests.oracles import Voxel

TAU = 4
INTERVALS = [range(first, last + 1) for first in range(TAU) for last in range(first, TAU)]


def volume(filled: dict[Voxel, range], n_frames: int = TAU) -> MotionHistoryVolume:
    frames = np.zeros((9, 3, 2, 1), np.uint64)
    for (x, y, z), when in filled.items():
        frames[x, y, z, 0] = sum(1 << i for i in when)
    return MotionHistoryVolume(VoxelGrid((-4, 2, 0), (9, 3, 2), 0.01), frames, n_frames)


def met(meeting: Meeting) -> bool:
    """Whether two volumes meet as they lie, told without the search."""
    common = intersection(meeting.a.whole, meeting.b.whole).frames
    if meeting.every is None:
        return bool(common.any())
    seen = np.bitwise_or.reduce(common.reshape(-1, common.shape[-1]), axis=0)
    return bool((seen & meeting.every == meeting.every).all())


def holds(clause: Clause) -> bool:
    return any(all(map(met, option.must)) and not any(map(met, option.never)) for option in clause.options)


def satisfied(kind: InteractionType, a: dict[Voxel, range], b: dict[Voxel, range], slack: Slack = Slack()) -> bool:  # noqa: B008
    return all(map(holds, temporal_clauses(kind, volume(a), volume(b), slack=slack)))


EQUATIONS: dict[
    str, Callable[[int, int, int, int], bool]
] = {  # of (first of A, last of A, first of B, last of B) on a single contact voxel
    "+&+": lambda a0, a1, b0, b1: a1 == 3 and b1 == 3,
    "-&-": lambda a0, a1, b0, b1: a0 == 0 and b0 == 0,
    "+&-": lambda a0, a1, b0, b1: a1 == 3 and b0 == 0,
    "-&+": lambda a0, a1, b0, b1: a0 == 0 and b1 == 3,
    "+&0": lambda a0, a1, b0, b1: a1 == 3,
    "0&+": lambda a0, a1, b0, b1: b1 == 3,
    "-&0": lambda a0, a1, b0, b1: a0 == 0,
    "0&-": lambda a0, a1, b0, b1: b0 == 0,
    "0&0a": lambda a0, a1, b0, b1: (a0, a1, b0, b1) == (0, 3, 0, 3),
    "0&0b": lambda a0, a1, b0, b1: max(a0, b0) <= min(a1, b1),
    "0&0c": lambda a0, a1, b0, b1: a0 > b1 or b0 > a1,
    "none": lambda a0, a1, b0, b1: True,  # left to fidelity
}


@pytest.mark.parametrize("kind", InteractionType)
def test_every_type_is_its_equation_on_every_pair_of_intervals(kind: InteractionType) -> None:
    spot = (4, 1, 0)
    for at_a, at_b in product(INTERVALS, INTERVALS):
        expected = EQUATIONS[kind.value](at_a[0], at_a[-1], at_b[0], at_b[-1])
        assert satisfied(kind, {spot: at_a}, {spot: at_b}) == expected


@pytest.mark.parametrize("kind", InteractionType)
@pytest.mark.parametrize(("frames", "voxels"), [(1, 0.0), (0, 1.0), (2, 1.5), (9, 1.0)])
def test_two_contact_voxels_and_tolerances_agree_with_brute_force(
    kind: InteractionType, frames: int, voxels: float
) -> None:
    rng = np.random.default_rng(frames)
    spots = [(3, 1, 0), (5, 1, 0), (4, 1, 0), (4, 2, 1)]
    for _ in range(60):
        a, b = (
            {spots[i]: INTERVALS[rng.integers(10)] for i in rng.choice(4, rng.integers(1, 4), replace=False)}
            for _ in range(2)
        )
        plain = [{p: frozenset(when) for p, when in side.items()} for side in (a, b)]
        person = oracles.Person({}, {})
        s = oracles.Segment(person, person, kind.value, ("", ""), TAU, frames, voxels)
        why = oracles.why_not_in_time(s, plain[0], plain[1], oracles.neighbours(plain[0], voxels))
        assert satisfied(kind, a, b, Slack(frames, voxels)) == (why == "")


@pytest.mark.parametrize("kind", [kind for kind in InteractionType if kind is not InteractionType.NONE])
def test_every_type_asks_for_contact(kind: InteractionType) -> None:
    always = range(TAU)
    clauses = temporal_clauses(kind, volume({(0, 0, 0): always}), volume({(2, 0, 0): always}), slack=Slack())
    assert clauses[0].reason == NO_CONTACT and not holds(clauses[0])
    near = temporal_clauses(kind, volume({(0, 0, 0): always}), volume({(2, 0, 0): always}), slack=Slack(9, 2.0))
    assert holds(near[0])


def test_one_wrong_contact_voxel_spoils_the_others() -> None:
    """Eq. 8 asks it of all contact voxels."""
    right, wrong = range(1, TAU), range(1, 2)
    a = {(0, 0, 0): right, (1, 0, 0): wrong}
    assert satisfied(InteractionType.END_END, a, {(0, 0, 0): right})
    assert not satisfied(InteractionType.END_END, a, {(0, 0, 0): right, (1, 0, 0): right})


def test_a_voxel_that_is_left_and_entered_again_counts_in_the_frames_in_which_it_is_filled() -> None:
    """With intervals, eq. 6 would see A and B together in frame 1; with the set of frames they never are."""
    a, b = volume({}), volume({(0, 0, 0): range(1, 2)})
    frames = a.frames.copy()
    frames[0, 0, 0, 0] = 0b0101
    again = MotionHistoryVolume(a.grid, frames, TAU)
    contact, together = temporal_clauses(InteractionType.SOMETIMES, again, b, slack=Slack())
    assert holds(contact) and not holds(together)


def test_passing_asks_one_order_for_all_contact_voxels() -> None:
    """Eq. 7: A passes behind B in one voxel and before it in the other."""
    a = {(0, 0, 0): range(3, 4), (1, 0, 0): range(0, 1)}
    b = {(0, 0, 0): range(1, 2), (1, 0, 0): range(1, 2)}
    assert not satisfied(InteractionType.PASSING, a, b)
    assert satisfied(InteractionType.PASSING, {(0, 0, 0): range(3, 4)}, b)
    assert satisfied(InteractionType.PASSING, {(1, 0, 0): range(0, 1)}, b)


def test_slack_excuses_the_first_and_last_frames_of_a_hold_but_never_all() -> None:
    spot = (0, 0, 0)
    late, always = {spot: range(1, 3)}, {spot: range(TAU)}
    assert not satisfied(InteractionType.THROUGHOUT, late, always)
    assert satisfied(InteractionType.THROUGHOUT, late, always, Slack(1))
    assert satisfied(InteractionType.THROUGHOUT, late, always, Slack(99))
    assert not satisfied(InteractionType.THROUGHOUT, {spot: range(0, 1)}, always, Slack(99))


def test_the_moments_of_a_volume() -> None:
    sweep = volume({(x, 0, 0): range(x, x + 1) for x in range(TAU)})
    assert [
        int(filled.sum()) for filled in (ever(sweep).filled, ending(sweep, 0).filled, starting(sweep, 0).filled)
    ] == [4, 1, 1]
    assert (int(ending(sweep, 2).filled.sum()), int(starting(sweep, 2).filled.sum())) == (3, 3)
    assert (int(ending(sweep, 50).filled.sum()), int(starting(sweep, 50).filled.sum())) == (4, 4)


def test_the_table_is_complete_and_mirroring_twice_changes_nothing() -> None:
    assert set(TEMPORAL) == set(InteractionType) and len(InteractionType) == 12
    for kind in InteractionType:
        assert kind.mirrored.mirrored is kind
        swapped = "&".join(reversed(kind.value.split("&"))) if "a" not in kind and "b" not in kind else kind.value
        assert kind.mirrored.value == (swapped if kind in MIRROR else kind.value)


@pytest.mark.parametrize("kind", InteractionType)
def test_the_mirrored_type_says_the_same_with_the_roles_swapped(kind: InteractionType) -> None:
    spot = (4, 1, 0)
    for at_a, at_b in product(INTERVALS, INTERVALS):
        assert satisfied(kind, {spot: at_a}, {spot: at_b}) == satisfied(kind.mirrored, {spot: at_b}, {spot: at_a})


def test_types_that_do_not_touch_are_those_that_keep_apart_altogether() -> None:
    """Spec section 6: by default everything keeps apart for `0&0c` and `none`."""
    assert [kind.value for kind in InteractionType if not kind.touches] == ["0&0c", "none"]
