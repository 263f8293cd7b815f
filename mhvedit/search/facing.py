"""The two volumes of a meeting arranged for the search, side by side: in one layout, 64 frames at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

from mhvedit.constraints.clauses import Meeting
from mhvedit.search.columns import WORD, Columns, Layout, columns_of, fitted_layout
from mhvedit.search.pyramid import SLABS, Pyramid, is_solid, pyramid_of
from mhvedit.volumes.history import Volume, word_count


@dataclass(frozen=True, slots=True, eq=False)
class Facing:
    """A meeting in 64 of its frames."""

    a: Pyramid
    b: Columns
    solid: bool  # whether B is thick enough to settle blocks of shifts
    every: int | None  # bits that must all occur in common; None: any


def facings_of(meetings: Sequence[Meeting]) -> dict[int, tuple[Facing, ...]]:
    """Arrange volumes; those that several meetings name, once.

    Args:
        meetings: of a search.

    Returns:
        By identity of the meeting: one facing for each 64 frames of which any is asked for.
    """
    heights = _heights(meetings)
    pyramids: dict[tuple[int, Layout, int], Pyramid] = {}
    columns: dict[tuple[int, int], tuple[Columns, bool]] = {}
    found = {}
    for meeting in meetings:
        a, b, own = meeting.a, meeting.b, []
        layout = fitted_layout(*heights[id(b)], n_frames=min(b.n_frames, WORD), n_slabs=SLABS)
        for word in range(word_count(b.n_frames)):
            every = None if meeting.every is None else int(meeting.every[word])
            if every == 0:
                continue
            if (id(b), word) not in columns:
                made = columns_of(b, layout, word=word)
                columns[id(b), word] = made, is_solid(made)
            if (id(a), layout, word) not in pyramids:
                pyramids[id(a), layout, word] = pyramid_of(columns_of(a, layout, word=word))
            own.append(Facing(pyramids[id(a), layout, word], *columns[id(b), word], every))
        found[id(meeting)] = tuple(own)
    return found


def _heights(meetings: Sequence[Meeting]) -> dict[int, tuple[int, int]]:
    """By identity of B: first and past-the-last lattice index along z at which it can meet anything it faces."""
    found: dict[int, tuple[int, int]] = {}
    for meeting in meetings:
        (low_a, high_a), (low_b, high_b) = _height(meeting.a), _height(meeting.b)
        low, high = max(low_a, low_b), min(high_a, high_b)
        if low >= high:
            low, high = low_b, low_b + 1
        before = found.get(id(meeting.b), (low, high))
        found[id(meeting.b)] = min(low, before[0]), max(high, before[1])
    return found


def _height(volume: Volume) -> tuple[int, int]:
    """First and past-the-last lattice index of a volume along z."""
    low = volume.grid.start[2]
    return low, low + volume.grid.shape[2]
