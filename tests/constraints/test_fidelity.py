"""What must not meet, and how deep what touches may sink (eq. 15), on boxes whose depths are known."""

import numpy as np
import pytest

from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import InteractionType
from mhvedit.constraints.fidelity import BODIES_MEET, TOO_DEEP, fidelity_clauses
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.meshes import BODY
from mhvedit.volumes.history import MotionHistoryVolume, intersection
from mhvedit.volumes.subject import PartVolume, SubjectVolumes

PITCH = 0.01
HAND, SWORD = "hand", "sword"


def bar(start: int, stop: int, *, frames: int = 0b11) -> MotionHistoryVolume:
    """A bar of 9 x 9 voxels along x, so that depth along it is what counts near its ends."""
    shape = (stop - start, 9, 9)
    return MotionHistoryVolume(VoxelGrid((start, -4, -4), shape, PITCH), np.full((*shape, 1), frames, np.uint64), 2)


def subject(
    body: MotionHistoryVolume, hand: MotionHistoryVolume, sword: MotionHistoryVolume | None = None
) -> SubjectVolumes:
    solids = {BODY: body} | ({} if sword is None else {SWORD: sword})
    parts = {BODY: PartVolume(body, BODY), HAND: PartVolume(hand, BODY)}
    return SubjectVolumes(solids, parts | ({} if sword is None else {SWORD: PartVolume(sword, SWORD)}))


def broken(
    a: SubjectVolumes, b: SubjectVolumes, *, kind: str = "0&0b", parts: tuple[str, str] = (HAND, HAND),
    apart: list[tuple[str, str]] | None = None, depth: float = 0.0, overlap: float = 0.0,
) -> list[str]:  # fmt: skip
    """Reasons of the clauses that do not hold where the subjects lie; depths in voxels."""
    clauses = fidelity_clauses(
        InteractionType(kind), a, b, parts=parts, apart=apart, depth=depth * PITCH, overlap=overlap * PITCH, pitch=PITCH
    )
    return [clause.reason for clause in clauses if is_broken(clause)]


def is_broken(clause: Clause) -> bool:
    return any(bool(intersection(m.a.whole, m.b.whole).frames.any()) for m in clause.options[0].never)


def two_hands(shared: int) -> tuple[SubjectVolumes, SubjectVolumes]:
    """Bodies from the left and from the right whose hands, 5 long, share so many layers of voxels."""
    left, right = bar(-30, 0), bar(-shared, 30)
    return subject(left, bar(-5, 0)), subject(right, bar(-shared, 5 - shared))


@pytest.mark.parametrize(("shared", "deepest"), [(1, 0.5), (2, 1.5), (3, 2.5), (4, 3.5)])
def test_hands_may_sink_in_as_far_as_depth_and_no_farther(shared: int, deepest: float) -> None:
    """`shared` layers: the innermost shared voxel of A lies that many layers inside A, less half a voxel."""
    a, b = two_hands(shared)
    assert broken(a, b, depth=deepest) == []
    assert broken(a, b, depth=deepest - 0.01) == ([TOO_DEEP] if shared > 1 else [])


def test_interest_parts_may_always_share_surface_voxels() -> None:
    a, b = two_hands(1)
    assert broken(a, b, depth=0.0) == []


def test_what_keeps_apart_shares_not_even_a_surface_voxel_in_any_frame() -> None:
    body = bar(-30, 0)
    a = subject(body, bar(-30, -28))
    for frames, expected in ((0b01, [BODIES_MEET]), (0b10, [BODIES_MEET]), (0b00, [])):
        b = subject(bar(-1, 30, frames=frames), bar(28, 30, frames=frames))
        assert broken(a, b) == expected


def test_bodies_in_the_same_place_at_other_times_do_not_meet() -> None:
    a = subject(bar(-30, 0, frames=0b01), bar(-5, 0, frames=0b01))
    b = subject(bar(-30, 0, frames=0b10), bar(-5, 0, frames=0b10))
    for kind in InteractionType:
        assert broken(a, b, kind=kind) == []


@pytest.mark.parametrize(("overlap", "expected"), [(0.0, [BODIES_MEET]), (0.4, [BODIES_MEET]), (0.5, []), (1.0, [])])
def test_overlap_excuses_voxels_that_are_no_deeper(overlap: float, expected: list[str]) -> None:
    """A surface voxel lies half a voxel deep."""
    a, b = subject(bar(-30, 0), bar(-30, -28)), subject(bar(-1, 30), bar(28, 30))
    assert broken(a, b, overlap=overlap) == expected


def test_a_hand_may_not_meet_the_others_rest_nor_rest_the_hand() -> None:
    hand_of_a, hand_of_b = bar(-5, 0), bar(20, 30)
    a, b = subject(bar(-30, 0), hand_of_a), subject(bar(-1, 30), hand_of_b)
    assert broken(a, b) == [BODIES_MEET] and broken(b, a) == [BODIES_MEET]


@pytest.mark.parametrize("kind", ["0&0c", "none"])
def test_types_that_do_not_touch_excuse_no_part(kind: str) -> None:
    a, b = two_hands(1)
    assert broken(a, b, kind=kind) == [BODIES_MEET]
    assert broken(a, b, kind=kind, overlap=0.5) == []


def test_a_list_of_pairs_replaces_the_default() -> None:
    a, b = subject(bar(-30, 0), bar(-30, -28)), subject(bar(-1, 30), bar(28, 30))
    assert broken(a, b, apart=[]) == []
    assert broken(a, b, apart=[(HAND, HAND), (HAND, BODY)]) == []
    assert broken(a, b, apart=[(HAND, HAND), (BODY, BODY)]) == [BODIES_MEET]


def test_a_sword_of_its_own_mesh_is_solid_too() -> None:
    """Nothing may meet a sword that nobody named; if the sword is the interest part, the body is the rest."""
    a = subject(bar(-30, 0), bar(-2, 0), bar(0, 8))
    b = subject(bar(7, 30), bar(28, 30))
    assert broken(a, b) == [BODIES_MEET]
    assert broken(a, b, parts=(SWORD, BODY)) == []
    assert broken(a, subject(bar(-1, 30), bar(28, 30)), parts=(SWORD, BODY), depth=9) == [BODIES_MEET]


def test_depth_is_measured_in_the_solid_that_a_part_is_cut_from() -> None:
    """A hand one voxel thick in the middle of an arm lies deep in the arm, though itself it is all surface."""
    arm = bar(-30, 1)
    a, b = subject(arm, bar(-3, -2)), subject(bar(-3, -2), bar(-3, -2))
    assert broken(a, b, depth=3.0) == [TOO_DEEP]
    assert broken(a, b, depth=3.5) == []
