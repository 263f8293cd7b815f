"""What a check of an edited scene found, the thresholds it is held to, and the sentences that say where it fails."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mhvedit.errors import counted
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.scene.contact import TOUCH, Verdict, spans, touch_string
from mhvedit.scene.motion import AddedMotion


@dataclass(frozen=True, slots=True, eq=False)
class PairReport:
    """Two subjects through the whole scene."""

    between: tuple[str, str]
    gap: FloatArray  # (N,) m, negative: how deep one is in the other; inf where further apart than the reach
    crossing: BoolArray  # (N,) whether their surfaces cross, or one holds the other
    where: FloatArray  # (N, 3) m, where they are deepest or nearest, in the world; NaN where far
    solids: tuple[tuple[str, str] | None, ...]  # (N,) which solids that is: `body` or a thing held; None where far
    between_gap: FloatArray | None  # (N - 1,) m, smallest gap at the sub-steps after each frame; None where not asked

    @property
    def deepest(self) -> float:
        """Deepest penetration in a frame, m."""
        return max(0.0, -float(self.gap.min(initial=np.inf)))

    @property
    def deepest_frame(self) -> int | None:
        """In which frame; None where they never meet."""
        return int(self.gap.argmin()) if self.deepest > 0 else None


@dataclass(frozen=True, slots=True)
class SightReport:
    """Who sees whom in the asked frames of a segment."""

    first: int  # frame of the scene
    a_sees_b: tuple[bool, ...]
    b_sees_a: tuple[bool, ...]

    @property
    def holds(self) -> bool:
        """Whether each has the other in sight in some frame (Shi et al., eq. 14)."""
        return any(self.a_sees_b) and any(self.b_sees_a)


@dataclass(frozen=True, slots=True, eq=False)
class SegmentReport:
    """One key segment on the meshes; arrays count its frames from `start`."""

    name: str
    between: tuple[str, str]
    interaction: str
    parts: tuple[str, str]
    start: int
    stop: int
    body_gap: FloatArray  # (n,) m, between all of both
    part_gap: FloatArray  # (n,) m, between the two parts
    reach_gap: FloatArray  # (n,) m, between either's part and all of the other
    part_place: FloatArray  # (n, 3) m, where the parts are nearest or deepest, in the world; NaN where far
    verdict: Verdict
    sight: SightReport | None

    @property
    def deepest(self) -> float:
        """Deepest penetration of the bodies, m."""
        return max(0.0, -float(self.body_gap.min(initial=np.inf)))

    @property
    def contact_frames(self) -> tuple[int, ...]:
        """Frames of the scene in which the two parts touch."""
        return tuple(int(i) + self.start for i in np.flatnonzero(self.part_gap < TOUCH))


@dataclass(frozen=True, slots=True, eq=False)
class SceneReport:
    """Everything that a check found."""

    name: str
    n_frames: int
    fps: float  # Hz
    reach: float  # m, gaps wider than this are inf
    between_frames: int  # sub-steps
    pairs: tuple[PairReport, ...]
    segments: tuple[SegmentReport, ...]
    motions: tuple[AddedMotion, ...]  # by subject
    off_floor: Mapping[str, tuple[int, ...]] = field(default_factory=dict)  # by subject, frames; where there is a floor

    @property
    def deepest(self) -> float:
        """Deepest penetration anywhere, m."""
        return max((pair.deepest for pair in self.pairs), default=0.0)


@dataclass(frozen=True, slots=True)
class Thresholds:
    """How good is good enough: the options of `mhvedit check`, hence mm, degrees and m/s."""

    penetration_mm: float = (
        60.0  # of anybody into anybody; grasps of rigid hands overlap by 10-20 mm, holds by up to 45
    )
    skate_mps: float = 0.5  # added at the soles
    step_mm: float = 50.0  # added from one frame to the next
    turn_deg: float = 10.0  # added from one frame to the next
    jump_mps: float = 1.0  # change of the added velocity from one frame to the next
    types: bool = True  # whether each segment must do what its type asks
    sight: bool = True  # whether people must see each other where that was asked


def failures(report: SceneReport, thresholds: Thresholds) -> tuple[str, ...]:
    """One sentence for every threshold that is passed: which, where and by how much.

    Args:
        report: of `check_scene`.
        thresholds: what is good enough.
    """
    found = [s for pair in report.pairs for s in _too_deep(report, pair, thresholds.penetration_mm)]
    for segment in report.segments:
        found += _segment_failures(segment, thresholds)
    for motion in report.motions:
        found += _motion_failures(report, motion, thresholds)
    found += [f"stage: {name} leaves the floor in frames {spans(off)}" for name, off in report.off_floor.items() if off]
    return tuple(found)


def stretch_name(report: SceneReport, frame: int, between: tuple[str, str]) -> str:
    """Where a frame lies for a pair: `segment x`, or before, after or between which.

    Args:
        report: of `check_scene`.
        frame: of the scene.
        between: the two subjects.
    """
    own = sorted((s for s in report.segments if set(s.between) == set(between)), key=lambda s: s.start)
    for segment in own:
        if segment.start <= frame < segment.stop:
            return f"segment {segment.name}"
    before = [s.name for s in own if s.stop <= frame]
    after = [s.name for s in own if s.start > frame]
    if before and after:
        return f"between {before[-1]} and {after[0]}"
    if before:
        return f"after {before[-1]}"
    return f"before {after[0]}" if after else "no segment of theirs"


def report_as_dict(report: SceneReport) -> dict[str, Any]:
    """The content of `report.json` that a check adds: plain types; lengths in mm, null where far or unknown."""
    return {
        "name": report.name,
        "frames": report.n_frames,
        "fps": report.fps,
        "reach_mm": _mm(report.reach),
        "touch_mm": _mm(TOUCH),
        "deepest_mm": _mm(report.deepest),
        "between_frames": report.between_frames,
        "pairs": [_pair_as_dict(report, pair) for pair in report.pairs],
        "segments": [_segment_as_dict(segment) for segment in report.segments],
        "off_floor": {name: list(frames) for name, frames in report.off_floor.items()},
        "motions": {motion.subject: _motion_as_dict(report, motion) for motion in report.motions},
    }


def _too_deep(report: SceneReport, pair: PairReport, limit: float) -> Iterator[str]:
    """The worst frame of each stretch in which a pair is too deep, and the worst sub-step where frames are fine."""
    names = [stretch_name(report, k, pair.between) for k in range(report.n_frames)]
    who = " and ".join(pair.between)
    deep = -pair.gap * 1000
    for name in dict.fromkeys(names[k] for k in np.flatnonzero(deep > limit)):
        inside = [k for k in range(report.n_frames) if names[k] == name]
        worst = max(inside, key=lambda k: float(deep[k]))
        solids = " in ".join(pair.solids[worst] or ())
        count = sum(bool(deep[k] > limit) for k in inside)
        yield (
            f"penetration: {who} are {deep[worst]:.1f} mm deep in each other ({solids}) in frame {worst} ({name}), "
            f"{deep[worst] - limit:.1f} mm over the {limit:g} mm allowed, in {count} of its frames"
        )
    if pair.between_gap is not None and len(pair.between_gap):
        worst = int(pair.between_gap.argmin())
        most = -pair.between_gap[worst] * 1000
        if most > max(limit, float(deep.max())):
            yield (
                f"penetration: {who} are {most:.1f} mm deep in each other between frames {worst} and {worst + 1} "
                f"({names[worst]}), {most - limit:.1f} mm over the {limit:g} mm allowed"
            )


def _segment_failures(segment: SegmentReport, thresholds: Thresholds) -> Iterator[str]:
    who = f"segment {segment.name} ({' and '.join(segment.between)}, frames {segment.start}-{segment.stop - 1})"
    if thresholds.types and not segment.verdict.agrees:
        yield f"contact: {who}: {segment.verdict.sentence}"
    if thresholds.sight and segment.sight is not None and not segment.sight.holds:
        a, b = segment.between
        blind = [f"{x} never sees {y}" for x, y, seen in _looks(segment.sight, a, b) if not any(seen)]
        yield f"sight: {who}: {' and '.join(blind)}"


def _looks(sight: SightReport, a: str, b: str) -> tuple[tuple[str, str, tuple[bool, ...]], ...]:
    return (a, b, sight.a_sees_b), (b, a, sight.b_sees_a)


def _motion_failures(report: SceneReport, motion: AddedMotion, thresholds: Thresholds) -> Iterator[str]:
    kinds = (
        ("skate", motion.skate * report.fps, thresholds.skate_mps, "m/s", "soles are moved by"),
        ("step", motion.step * 1000, thresholds.step_mm, "mm", "the edit lengthens the step by"),
        ("turn", np.degrees(motion.turn), thresholds.turn_deg, "degrees", "the edit turns by"),
        ("jump", motion.jump * report.fps, thresholds.jump_mps, "m/s", "the added velocity changes by"),
    )
    for kind, values, limit, unit, words in kinds:
        if not (values > limit).any():
            continue
        worst = int(np.nanargmax(values))
        when = f"at frame {worst + 1}" if kind == "jump" else f"from frame {worst} to {worst + 1}"
        yield (
            f"{kind}: {motion.subject}: {words} {values[worst]:.2f} {unit} {when}, "
            f"{values[worst] - limit:.2f} {unit} over the {limit:g} {unit} allowed, "
            f"in {counted((values > limit).sum(), 'frame')}"
        )


def _pair_as_dict(report: SceneReport, pair: PairReport) -> dict[str, Any]:
    frame = pair.deepest_frame
    found = {
        "between": list(pair.between),
        "deepest_mm": _mm(pair.deepest),
        "deepest_frame": frame,
        "deepest_in": None if frame is None else stretch_name(report, frame, pair.between),
        "deepest_at": None if frame is None else _numbers(pair.where[frame], 1, 4),
        "deepest_solids": None if frame is None else list(pair.solids[frame] or ()),
        "gap_mm": _numbers(pair.gap, 1000, 2),
        "crossing_frames": [int(k) for k in np.flatnonzero(pair.crossing)],
    }
    if pair.between_gap is not None:
        found["between_gap_mm"] = _numbers(pair.between_gap, 1000, 2)
    return found


def _segment_as_dict(segment: SegmentReport) -> dict[str, Any]:
    sight = segment.sight
    return {
        "name": segment.name,
        "between": list(segment.between),
        "interaction": segment.interaction,
        "parts": list(segment.parts),
        "start": segment.start,
        "stop": segment.stop,
        "deepest_mm": _mm(segment.deepest),
        "body_touch": touch_string(segment.body_gap),
        "part_touch": touch_string(segment.reach_gap),
        "touch": touch_string(segment.part_gap),
        "part_gap_mm": _numbers(segment.part_gap, 1000, 2),
        "contact_frames": list(segment.contact_frames),
        "contact_at": [_numbers(segment.part_place[k - segment.start], 1, 4) for k in segment.contact_frames],
        "agrees": segment.verdict.agrees,
        "verdict": segment.verdict.sentence,
        "sight": None
        if sight is None
        else {
            "holds": sight.holds,
            "first": sight.first,
            "a_sees_b": touch_string(np.where(sight.a_sees_b, 0.0, 1.0)),
            "b_sees_a": touch_string(np.where(sight.b_sees_a, 0.0, 1.0)),
        },
    }


def _motion_as_dict(report: SceneReport, motion: AddedMotion) -> dict[str, Any]:
    on_floor = motion.skate[np.isfinite(motion.skate)]
    return {
        "skate": _largest(motion.skate, 1000, "mm") | _largest(motion.skate, report.fps, "mps"),
        "mean_skate_mm": round(float(on_floor.mean()) * 1000, 2) if len(on_floor) else None,
        "mean_skate_mps": round(float(on_floor.mean()) * report.fps, 4) if len(on_floor) else None,
        "step": _largest(motion.step, 1000, "mm"),
        "shift": _largest(motion.shift, 1000, "mm"),
        "turn": _largest(motion.turn, 180 / np.pi, "deg"),
        "jump": _largest(motion.jump, report.fps, "mps"),
        "skate_mm": _numbers(motion.skate, 1000, 2),
        "step_mm": _numbers(motion.step, 1000, 2),
    }


def _largest(values: FloatArray, scale: float, unit: str) -> dict[str, Any]:
    """The largest value, and the frame from which it leads to the next; null where there is none."""
    if not np.isfinite(values).any():
        return {unit: None, "frame": None}
    worst = int(np.nanargmax(values))
    return {unit: round(float(values[worst]) * scale, 3), "frame": worst}


def _mm(length: float) -> float:
    return round(length * 1000, 2)


def _numbers(values: FloatArray, scale: float, digits: int) -> list[float | None]:
    return [round(float(v) * scale, digits) if np.isfinite(v) else None for v in values]
