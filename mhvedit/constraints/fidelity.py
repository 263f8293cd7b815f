"""Fidelity: what must not meet, in any frame (Shi et al., eq. 15), and how far what touches may sink in.

Depth is distance to the other's surface. The depth of a voxel is its distance, centre to centre, to the nearest empty
voxel of the solid that it belongs to, less half a voxel. What must stay apart shares no voxel deeper than `apart`
(none at all for 0); interest parts share none deeper than `depth`, but may always share surface voxels, since they
touch.
"""

from collections.abc import Sequence

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.constraints.dictionary import InteractionType
from mhvedit.volumes.history import MotionHistoryVolume, Volume, eroded
from mhvedit.volumes.subject import (
    SubjectVolumes,
    all_of,
    deep_all_of,
    deep_part_of,
    deep_rest_of,
    part_of,
    rest_of,
)

TOO_DEEP = "contact sinks in too deep"
BODIES_MEET = "bodies meet"
HALF_VOXEL = 0.5


class Depth:
    """What lies deeper in a solid than a radius (voxels, centre to empty centre); each solid is eroded once."""

    def __init__(self, radius: float) -> None:
        self.radius = radius
        self._eroded: dict[MotionHistoryVolume, MotionHistoryVolume] = {}  # by identity

    def __call__(self, solid: MotionHistoryVolume) -> MotionHistoryVolume:
        """The deep part of a solid."""
        if solid not in self._eroded:
            self._eroded[solid] = eroded(solid, self.radius)
        return self._eroded[solid]


def fidelity_clauses(
    interaction: InteractionType,
    a: SubjectVolumes,
    b: SubjectVolumes,
    *,
    parts: tuple[str, str],
    apart: Sequence[tuple[str, str]] | None,
    depth: float,
    overlap: float,
    pitch: float,
) -> tuple[Clause, ...]:
    """What must keep apart through a segment (Shi et al., eq. 15).

    Args:
        interaction: type of the segment.
        a: first subject.
        b: second subject.
        parts: names of the interest parts.
        apart: pairs of parts that must not meet; None for all but the two interest parts of a type that touches.
        depth: how far interest parts may sink into each other, m.
        overlap: how far what must stay apart may overlap, m.
        pitch: voxel size, m.
    """
    clauses = []
    free = overlap / pitch + HALF_VOXEL if overlap > 0 else 0.0
    if interaction.touches:
        sunk = Depth(max(depth / pitch, HALF_VOXEL) + HALF_VOXEL)
        clauses.append(_never(TOO_DEEP, _sinking(a, b, parts, sunk)))
    deep = Depth(free)
    if apart is not None:
        meetings = tuple(m for pair in apart for m in _sinking(a, b, pair, deep))
        clauses.append(_never(BODIES_MEET, meetings))
    elif interaction.touches:
        clauses.append(_never(BODIES_MEET, _rests_meet(a, b, parts, deep)))
    else:
        pairs = (all_of(a), deep_all_of(b, deep)), (deep_all_of(a, deep), all_of(b))
        clauses.append(_never(BODIES_MEET, _distinct(pairs, deep)))
    return tuple(clause for clause in clauses if clause.options[0].never)


def _never(reason: str, meetings: tuple[Meeting, ...]) -> Clause:
    return Clause(reason, (Option(never=meetings),))


def _sinking(a: SubjectVolumes, b: SubjectVolumes, parts: tuple[str, str], deep: Depth) -> tuple[Meeting, ...]:
    """One part's voxels with what lies deep in the other's, both ways."""
    pair = (
        (part_of(a, parts[0]), deep_part_of(b, parts[1], deep)),
        (deep_part_of(a, parts[0], deep), part_of(b, parts[1])),
    )
    return _distinct(pair, deep)


def _rests_meet(a: SubjectVolumes, b: SubjectVolumes, parts: tuple[str, str], deep: Depth) -> tuple[Meeting, ...]:
    """Rest with all of the other, and interest part with the other's rest."""
    sides = (
        (rest_of(a, parts[0]), deep_all_of(b, deep)),
        (deep_rest_of(a, parts[0], deep), all_of(b)),
    )
    ends = (
        (part_of(a, parts[0]), deep_rest_of(b, parts[1], deep)),
        (deep_part_of(a, parts[0], deep), rest_of(b, parts[1])),
    )
    return _distinct(sides, deep) + _distinct(ends, deep)


def _distinct(pairs: tuple[tuple[Volume, Volume], ...], deep: Depth) -> tuple[Meeting, ...]:
    """The meetings that can happen; below a depth of one voxel nothing is eroded and both ways are the same."""
    chosen = pairs[:1] if deep.radius < 1 else pairs
    return tuple(meeting for meeting in (Meeting(a, b) for a, b in chosen) if meeting.possible)
