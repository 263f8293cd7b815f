"""The `[[segments]]` of a scene file, and the order that they must be in."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.project.schema import Exclusion, SegmentSpec, Spot, SubjectSpec, Tolerance, Visibility
from mhvedit.project.values import Value, fields, is_name, name, number, one_of, shown, span, table, whole
from mhvedit.sequences.meshes import BODY
from mhvedit.sequences.segments import Retiming, shared_length

KEYS: Final[Mapping[str, Any]] = {
    "name": None,
    "between": None,
    "frames": None,
    "interaction": None,
    "parts": {},
    "apart": "auto",
    "visibility": False,
    "retime": "endpoints",
    "tolerance": {},
    "pin": None,
    "exclude": [],
    "window": None,
}
SPOT: Final[Mapping[str, Any]] = {"x": None, "y": None, "yaw": None}
PAIRS: Final = '"auto", "none", or pairs like ["body", "body"]'


def segment_specs(at: Value, subjects: Mapping[str, SubjectSpec]) -> tuple[SegmentSpec, ...]:
    """All segments, checked, also against each other.

    Args:
        at: the array of their tables.
        subjects: by name.

    Raises:
        SceneError: naming the key, what was expected and what is there.
    """
    if not isinstance(at.value, list) or not at.value:
        raise at.error("at least one [[segments]]")
    segments = tuple(_segment(at.at(i, value), i, subjects) for i, value in enumerate(at.value))
    _check_names(at, segments)
    for subject in subjects:
        own = [segment for segment in segments if subject in segment.between]
        for earlier, later in pairwise(own):
            _check_order(at, earlier, later, subject)
    return segments


def check_visible_frames(file: Path, segment: SegmentSpec, *, fps: float, rates: tuple[float, float]) -> None:
    """Check that the frames that visibility asks for lie in the segment as it will be in the scene.

    Args:
        file: the scene file.
        segment: one of its segments.
        fps: Hz, of the scene.
        rates: Hz, of the captures of A and of B.

    Raises:
        SceneError: they do not.
    """
    if segment.visibility is None or segment.visibility.frames is None:
        return
    a, b = (len(segment.frames[who]) for who in segment.between)
    n_frames = shared_length(a, b, rates=(fps / rates[0], fps / rates[1]))
    wanted = segment.visibility.frames
    if wanted.start < 0 or wanted.stop > n_frames:
        expected = f"frames of the segment, counted from 0 to {n_frames - 1}"
        raise Value(file, f"{segment.key}.visibility.frames", None).error(expected, _inclusive(wanted))


def _segment(at: Value, index: int, subjects: Mapping[str, SubjectSpec]) -> SegmentSpec:
    """One segment; errors say its name, where it has one."""
    known_as = table(at).get("name")
    entries = fields(Value(at.file, f'{at.key} "{known_as}"' if is_name(known_as) else at.key, at.value), KEYS)
    between = _between(entries["between"], subjects)
    ranges = {who: span(entry) for who, entry in fields(entries["frames"], dict.fromkeys(between)).items()}
    parts = fields(entries["parts"], dict.fromkeys(between, BODY))
    return SegmentSpec(
        index=index,
        name=name(entries["name"]),
        between=between,
        frames=ranges,
        interaction=InteractionType(one_of(entries["interaction"], [kind.value for kind in InteractionType])),
        parts={who: one_of(parts[who], _part_names(subjects[who])) for who in between},
        apart=_apart(entries["apart"], between, subjects),
        visibility=_visibility(entries["visibility"]),
        retime=Retiming(one_of(entries["retime"], [how.value for how in Retiming])),
        tolerance=_tolerance(entries["tolerance"]),
        pin=None if entries["pin"].value is None else _spot(fields(entries["pin"], SPOT)),
        exclude=_exclude(entries["exclude"]),
        window=None if entries["window"].value is None else number(entries["window"], above=0),
    )


def _between(at: Value, subjects: Mapping[str, SubjectSpec]) -> tuple[str, str]:
    """A and B."""
    if not isinstance(at.value, list) or len(at.value) != 2:
        raise at.error("two subjects, [A, B]")
    a, b = (one_of(at.at(i, value), subjects) for i, value in enumerate(at.value))
    if a == b:
        raise at.error("two different subjects, [A, B]")
    return a, b


def _part_names(subject: SubjectSpec) -> tuple[str, ...]:
    """All parts that a segment may name."""
    return BODY, *subject.parts


def _apart(
    at: Value, between: tuple[str, str], subjects: Mapping[str, SubjectSpec]
) -> tuple[tuple[str, str], ...] | None:
    """Pairs of parts that must not meet; None for "auto"."""
    if isinstance(at.value, str):
        return None if one_of(at, ("auto", "none")) == "auto" else ()
    if not isinstance(at.value, list):
        raise at.error(PAIRS)
    return tuple(_pair(at.at(i, value), between, subjects) for i, value in enumerate(at.value))


def _pair(at: Value, between: tuple[str, str], subjects: Mapping[str, SubjectSpec]) -> tuple[str, str]:
    """A part of A and one of B."""
    if not isinstance(at.value, list) or len(at.value) != 2:
        raise at.error(f"[a part of {between[0]}, a part of {between[1]}]")
    a, b = (one_of(at.at(i, at.value[i]), _part_names(subjects[who])) for i, who in enumerate(between))
    return a, b


def _visibility(at: Value) -> Visibility | None:
    """None for `false`."""
    if at.value is False:
        return None
    if not isinstance(at.value, dict):
        raise at.error("false or {half_angle = degrees}")
    entries = fields(at, {"half_angle": None, "frames": None})
    half_angle = math.radians(number(entries["half_angle"], above=0, most=180))
    return Visibility(half_angle, None if entries["frames"].value is None else span(entries["frames"]))


def _tolerance(at: Value) -> Tolerance:
    """How far a contact may miss."""
    entries = fields(at, asdict(Tolerance()))
    return Tolerance(
        frames=whole(entries["frames"], least=0),
        voxels=number(entries["voxels"], least=0),
        depth=number(entries["depth"], least=0),
        apart=number(entries["apart"], least=0),
    )


def _spot(entries: Mapping[str, Value]) -> Spot:
    """Where B stands beside A."""
    return Spot(number(entries["x"]), number(entries["y"]), math.radians(number(entries["yaw"])))


def _exclude(at: Value) -> tuple[Exclusion, ...]:
    """What the editor does not want."""
    if not isinstance(at.value, list):
        raise at.error("a list of tables such as x = 1.0, y = 0.0, yaw = 90")
    return tuple(_exclusion(at.at(i, value)) for i, value in enumerate(at.value))


def _exclusion(at: Value) -> Exclusion:
    """A region, or a neighbourhood."""
    entries = fields(at, {**SPOT, "radius": None, "turn": None})
    radius, turn = entries["radius"], entries["turn"]
    if radius.value is None:
        if turn.value is not None:
            raise turn.error("nothing where there is no radius")
        return Exclusion(_spot(entries), None)
    degrees = 180.0 if turn.value is None else number(turn, above=0, most=180)
    return Exclusion(_spot(entries), number(radius, above=0), math.radians(degrees))


def _check_names(at: Value, segments: tuple[SegmentSpec, ...]) -> None:
    """Each name once."""
    first: dict[str, SegmentSpec] = {}
    for segment in segments:
        known = first.setdefault(segment.name, segment)
        if known is not segment:
            key = f"{at.key}[{segment.index}].name"
            raise Value(at.file, key, segment.name).error(
                "a name that no other segment has", f"{shown(segment.name)}, as in {at.key}[{known.index}]"
            )


def _check_order(at: Value, earlier: SegmentSpec, later: SegmentSpec, subject: str) -> None:
    """A subject's segments follow each other as they do in the file."""
    a, b = earlier.frames[subject], later.frames[subject]
    if b.start >= a.stop:
        return
    how = "which overlaps" if b.stop > a.start else "which comes before"
    raise Value(at.file, f"{later.key}.frames.{subject}", None).error(
        f"frames after those of {earlier.key}, which end at {a[-1]}", f"{_inclusive(b)}, {how} {_inclusive(a)}"
    )


def _inclusive(frames: range) -> str:
    """As the file has it."""
    return f"[{frames[0]}, {frames[-1]}]"
