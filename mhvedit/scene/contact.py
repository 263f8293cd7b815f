"""Does what two parts do on the meshes agree with the interaction type that was asked (Shi et al., eqs 4 to 11)?

A type speaks of voxels that both parts sweep. On surfaces: (i) the parts *meet* at the type's moments, that is A's
part in a frame of its moment comes within `near` of B's part in a frame of B's moment (for `+&-` and `+&0` these need
not be the same frame); and (ii) wherever they really overlap in some frame, a part whose moment is the end is still
at that place at the end, and one whose moment is the start was already there at the start. Both with `frames` of
slack. (ii) looks at one place a frame, the deepest. What must not happen is judged by real overlap, what must happen
by nearness.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.scene.surfaces import Surface, clearance, open_surface, points_of_large_faces, signed_distances
from mhvedit.sequences.meshes import Mesh

TOUCH: Final = 0.010  # m: nearer than this counts as touching
CELL: Final = 0.03  # m, of the places that are compared for `0&0c`
CLEAR_ORDER: Final = 0.98  # share of the common places that one order must explain


@dataclass(frozen=True, slots=True)
class ContactSlack:
    """How far a segment's contact may miss."""

    frames: int = 0  # T_end - k still counts as the end, T_start + k as the start
    near: float = TOUCH  # m, parts nearer than this meet
    overlap: float = 0.0  # m, what must not meet may overlap this deep


@dataclass(frozen=True, slots=True, eq=False)
class PartSeries:
    """The interest parts of one segment, all in the frame of A's capture; None where a part is empty."""

    start: int  # frame of the scene at which the segment starts
    gap: FloatArray  # (n,) m, between the parts, negative: how deep; inf where far
    place: FloatArray  # (n, 3) m, where they are nearest or deepest
    a: tuple[Mesh | None, ...]  # (n,)
    b: tuple[Mesh | None, ...]  # (n,)
    workers: int = 1

    @property
    def n_frames(self) -> int:
        """Frames of the segment."""
        return len(self.gap)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a segment does what its type asks, and why."""

    agrees: bool
    sentence: str


class Moment(Enum):
    """When one part's side of a contact must be."""

    START = "-"
    END = "+"
    ANY = "0"


def judge_contact(interaction: InteractionType, parts: PartSeries, *, slack: ContactSlack) -> Verdict:
    """Compare a segment's contact on the meshes with its type.

    Args:
        interaction: what was asked.
        parts: the two parts in every frame of the segment.
        slack: tolerances.
    """
    if interaction in MOMENTS:
        agrees, why = _at_moments(parts, slack, MOMENTS[interaction])
    else:
        agrees, why = RULES[interaction](parts, slack)
    return Verdict(agrees, f"{interaction.value} {'holds' if agrees else 'does not hold'}: {why}")


MOMENTS: Final = {
    InteractionType.END_END: (Moment.END, Moment.END),
    InteractionType.START_START: (Moment.START, Moment.START),
    InteractionType.END_START: (Moment.END, Moment.START),
    InteractionType.START_END: (Moment.START, Moment.END),
    InteractionType.END_LATERAL: (Moment.END, Moment.ANY),
    InteractionType.LATERAL_END: (Moment.ANY, Moment.END),
    InteractionType.START_LATERAL: (Moment.START, Moment.ANY),
    InteractionType.LATERAL_START: (Moment.ANY, Moment.START),
}


def _at_moments(parts: PartSeries, slack: ContactSlack, moments: tuple[Moment, Moment]) -> tuple[bool, str]:
    """The parts meet at the asked moments, and what overlaps at other times is held to them or from them."""
    window_a, window_b = (_window(m, parts.n_frames, slack.frames) for m in moments)
    met = _meeting(parts, window_a, window_b, slack.near)
    if met is None:
        return False, f"the parts do not meet {_when(moments)} ({_closest(parts)})"
    elsewhere = [
        int(i)
        for i in np.flatnonzero(parts.gap < -slack.overlap)
        for side, moment, window in ((parts.a, moments[0], window_a), (parts.b, moments[1], window_b))
        if moment is not Moment.ANY and i not in window and not _at_place(parts, side, window, int(i), slack.near)
    ]
    if elsewhere:
        return False, f"the parts also meet elsewhere, in frames {spans(elsewhere, parts.start)}"
    i, j = met[0] + parts.start, met[1] + parts.start
    how = f"in touch in frame {i}" if i == j else f"A's part in frame {i} is where B's is in frame {j}"
    return (
        True,
        f"{how}; together within {slack.near * 1000:.0f} mm in frames {spans(_near(parts, slack), parts.start)}",
    )


def _meeting(parts: PartSeries, window_a: range, window_b: range, near: float) -> tuple[int, int] | None:
    """Frames of A and of B, one of each window, in which their parts are near each other; the same if possible."""
    both = [i for i in window_a if i in window_b and parts.gap[i] <= near]
    if both:
        best = min(both, key=lambda i: float(parts.gap[i]))
        return best, best
    if len(window_a) > len(window_b):
        swapped = _first_meeting(parts, (parts.b, window_b), (parts.a, window_a), near)
        return None if swapped is None else (swapped[1], swapped[0])
    return _first_meeting(parts, (parts.a, window_a), (parts.b, window_b), near)


def _first_meeting(
    parts: PartSeries,
    few: tuple[Sequence[Mesh | None], range],
    many: tuple[Sequence[Mesh | None], range],
    near: float,
) -> tuple[int, int] | None:
    """The fewer surfaces are kept open, the others are opened one after the other."""
    opened = {i: surface for i in few[1] if (surface := _opened(few[0][i], parts.workers)) is not None}
    for j in many[1]:
        other = _opened(many[0][j], parts.workers)
        for i, surface in opened.items():
            if i != j and other is not None and clearance(surface, other, reach=near + 1e-6).gap <= near:
                return i, j
    return None


def _at_place(parts: PartSeries, side: Sequence[Mesh | None], window: range, frame: int, near: float) -> bool:
    """Whether a part is, in some frame of a window, where the parts meet in another frame."""
    surfaces = (_opened(side[i], parts.workers) for i in window)
    return any(s is not None and signed_distances(s, parts.place[[frame]])[0] <= near for s in surfaces)


def _throughout(parts: PartSeries, slack: ContactSlack) -> tuple[bool, str]:
    """In touch in every frame; the first and last k are excused, but never all (eq. 5)."""
    k = min(slack.frames, (parts.n_frames - 1) // 2)
    asked = np.arange(k, parts.n_frames - k)
    lost = asked[parts.gap[asked] > slack.near]
    if len(lost):
        widest = int(lost[parts.gap[lost].argmax()])
        far = f"{parts.gap[widest] * 1000:.0f} mm" if np.isfinite(parts.gap[widest]) else "far"
        return False, f"contact is lost in frames {spans(lost, parts.start)} ({far} apart in {widest + parts.start})"
    return True, f"in touch in frames {spans(_near(parts, slack), parts.start)} of {_range(parts)}"


def _sometimes(parts: PartSeries, slack: ContactSlack) -> tuple[bool, str]:
    """In touch in some frame (eq. 6)."""
    near = _near(parts, slack)
    if len(near) == 0:
        return False, f"the parts are never in touch ({_closest(parts)})"
    return True, f"in touch in frames {spans(near, parts.start)}"


def _never(parts: PartSeries, slack: ContactSlack) -> tuple[bool, str]:
    """No contact at all."""
    overlapping = np.flatnonzero(parts.gap < -slack.overlap)
    if len(overlapping):
        return False, f"the parts meet in frames {spans(overlapping, parts.start)} ({_closest(parts)})"
    return True, f"the parts keep apart ({_closest(parts)})"


def _passing(parts: PartSeries, slack: ContactSlack) -> tuple[bool, str]:
    """One passes where the other has been, in one order for all places, and never at the same time (eq. 7)."""
    apart, why = _never(parts, slack)
    if not apart:
        return False, why
    a, b = _visited(parts.a), _visited(parts.b)
    _, at_a, at_b = np.intersect1d(a[0], b[0], return_indices=True)
    if len(at_a) == 0:
        return False, f"neither passes where the other has been ({_closest(parts)})"
    b_later = float((b[1][at_b] > a[2][at_a] - slack.frames).mean())
    a_later = float((a[1][at_a] > b[2][at_b] - slack.frames).mean())
    later, earlier, share = ("B", "A", b_later) if b_later >= a_later else ("A", "B", a_later)
    places = f"{later} passes where {earlier} has been, in {share:.0%} of {len(at_a)} places"
    return share >= CLEAR_ORDER, places


def _visited(meshes: Sequence[Mesh | None]) -> tuple[IntArray, IntArray, IntArray]:
    """Places that a surface comes through: their keys in ascending order, and the first and last frame of each."""
    keys, frames = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for i, mesh in enumerate(meshes):
        if mesh is None:
            continue
        extra, _ = points_of_large_faces(mesh.vertices, mesh.faces, spacing=CELL)
        cells = np.floor(np.concatenate([mesh.vertices, extra]) / CELL).astype(np.int64) + (1 << 20)
        keys.append(np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]))
        frames.append(np.full(len(keys[-1]), i))
    every, when = np.concatenate(keys), np.concatenate(frames)
    order = np.lexsort((when, every))
    every, when = every[order], when[order]
    found, first = np.unique(every, return_index=True)
    last = np.append(first[1:], len(every))[: len(first)] - 1
    return found, when[first], when[last]


RULES: Final[dict[InteractionType, Callable[[PartSeries, ContactSlack], tuple[bool, str]]]] = {
    InteractionType.THROUGHOUT: _throughout,
    InteractionType.SOMETIMES: _sometimes,
    InteractionType.PASSING: _passing,
    InteractionType.NONE: _never,
}


def spans(frames: Iterable[int], start: int = 0) -> str:
    """Frame numbers as a person writes them.

    >>> spans([3, 4, 5, 9], 10)
    '13-15, 19'
    """
    numbers = sorted({int(f) + start for f in frames})
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs) or "none"


def touch_string(gap: FloatArray) -> str:
    """`#` for every frame in touch, `.` for the others.

    >>> touch_string(np.array([0.2, 0.005, -0.01]))
    '.##'
    """
    return "".join("#" if g < TOUCH else "." for g in gap)


def cut_part(mesh: Mesh, belongs: BoolArray) -> Mesh | None:
    """The faces with a corner in a part, or None where there are none; the generalised winding number caps the cut.

    Args:
        mesh: whole.
        belongs: (V,) vertices of the part.
    """
    faces = mesh.faces[belongs[mesh.faces].any(1)]
    if len(faces) == 0:
        return None
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], compact.reshape(-1, 3).astype(np.int32))


def _window(moment: Moment, n_frames: int, k: int) -> range:
    if moment is Moment.ANY:
        return range(n_frames)
    return range(max(0, n_frames - 1 - k), n_frames) if moment is Moment.END else range(min(n_frames, k + 1))


def _opened(mesh: Mesh | None, workers: int) -> Surface | None:
    return None if mesh is None else open_surface(mesh, workers=workers)


def _near(parts: PartSeries, slack: ContactSlack) -> IntArray:
    return np.flatnonzero(parts.gap <= slack.near)


def _closest(parts: PartSeries) -> str:
    frame = int(parts.gap.argmin())
    gap = parts.gap[frame]
    if not np.isfinite(gap):
        return "far apart in every frame"
    how = f"{gap * 1000:.0f} mm apart" if gap >= 0 else f"{-gap * 1000:.1f} mm deep"
    return f"closest in frame {frame + parts.start}: {how}"


def _range(parts: PartSeries) -> str:
    return f"{parts.start}-{parts.start + parts.n_frames - 1}"


def _when(moments: tuple[Moment, Moment]) -> str:
    words = {Moment.START: "at its start", Moment.END: "at its end", Moment.ANY: "at any time"}
    if moments[0] is moments[1]:
        return "at the end" if moments[0] is Moment.END else "at the start"
    return f"with A {words[moments[0]]} and B {words[moments[1]]}"
