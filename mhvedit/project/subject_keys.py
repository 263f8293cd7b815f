"""The `[subjects.<name>]` tables of a scene file."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from mhvedit.project.schema import (
    FilePath,
    GazeSpec,
    InBoxSpec,
    NearBonesSpec,
    NearTrackSpec,
    OwnMeshSpec,
    PartSpec,
    SubjectSpec,
    WithLabelSpec,
)
from mhvedit.project.self_collision_keys import self_collision
from mhvedit.project.values import (
    Value,
    fields,
    file_path,
    listed,
    named,
    number,
    one_of,
    shown,
    span,
    suggestion,
    table,
    text,
    texts,
    triple,
    whole,
)
from mhvedit.sequences.axes import METRES, UP_AXES
from mhvedit.sequences.meshes import BODY

KEYS: Final[Mapping[str, Any]] = {
    "path": None,
    "frames": None,
    "fps": None,
    "units": "m",
    "up": "z",
    "facing": "auto",
    "gaze": "auto",
    "skeleton": None,
    "parts": {},
    "self_collision": None,
}
CAPTURE: Final = "a folder of numbered meshes, a .npz or a USD file"
TRACK: Final = "a track file"


def subject_spec(at: Value, name: str) -> SubjectSpec:
    """One subject, checked.

    Args:
        at: its table.
        name: of the subject.

    Raises:
        SceneError: naming the key, what was expected and what is there.
    """
    entries = fields(at, KEYS)
    skeleton = entries["skeleton"]
    spec = SubjectSpec(
        file=at.file,
        key=at.key,
        name=name,
        path=file_path(entries["path"], CAPTURE, folder_too=True),
        frames=None if entries["frames"].value is None else span(entries["frames"]),
        fps=None if entries["fps"].value is None else number(entries["fps"], above=0),
        units=one_of(entries["units"], METRES),
        up=one_of(entries["up"], UP_AXES),
        facing=_facing(entries["facing"]),
        gaze=_gaze(entries["gaze"]),
        skeleton=None if skeleton.value is None else file_path(skeleton, "a BVH file"),
        parts={part: _part(entry, part) for part, entry in named(entries["parts"]).items()},
        self_collision=None if entries["self_collision"].value is None else self_collision(entries["self_collision"]),
    )
    _check_bones(spec, entries["parts"])
    return spec


def _facing(at: Value) -> float | FilePath | None:
    """Degrees become radians; None is to be estimated."""
    if at.value == "auto":
        return None
    expected = f'"auto", degrees, or {TRACK}'
    if isinstance(at.value, str):
        return file_path(at, expected)
    if isinstance(at.value, bool) or not isinstance(at.value, int | float):
        raise at.error(expected)
    return math.radians(number(at))


def _gaze(at: Value) -> GazeSpec | None:
    """None is to be estimated."""
    if at.value == "auto":
        return None
    if not isinstance(at.value, dict):
        raise at.error('"auto" or {eye = a track file, target = a track file}')
    entries = fields(at, {"eye": None, "target": None})
    return GazeSpec(file_path(entries["eye"], TRACK), file_path(entries["target"], TRACK))


def _part(at: Value, name: str) -> PartSpec:
    """A part of the kind that its keys speak for."""
    if name == BODY:
        raise at.error("another name", f"{BODY}, which is always the whole capture")
    inside = table(at)
    for key in inside:
        if key not in KIND_OF:
            raise at.at(key, None).error(listed(KIND_OF), f"an unknown key{suggestion(key, KIND_OF)}")
    kinds = list(dict.fromkeys(KIND_OF[key] for key in inside))
    if len(kinds) != 1:
        raise at.error(f"the keys of one kind of part: {'; '.join(_KINDS)}", ", ".join(inside) or shown({}))
    return PARTS[kinds[0]](fields(at, dict.fromkeys(kinds[0].split(", "))))


def _near_track(entries: Mapping[str, Value]) -> PartSpec:
    """What lies near a moving point or polyline."""
    joint = entries["joint"]
    if not isinstance(joint.value, str | list):
        raise joint.error("the name of a joint, or a list of joints")
    joints = texts(joint, "joints") if isinstance(joint.value, list) else (text(joint, "the name of a joint"),)
    return NearTrackSpec(file_path(entries["track"], TRACK), joints, number(entries["radius"], above=0))


def _own_mesh(entries: Mapping[str, Value]) -> PartSpec:
    """A mesh sequence of its own."""
    return OwnMeshSpec(file_path(entries["path"], CAPTURE, folder_too=True))


def _in_box(entries: Mapping[str, Value]) -> PartSpec:
    """A fixed box."""
    return InBoxSpec(triple(entries["center"]), triple(entries["size"], above=0))


def _with_label(entries: Mapping[str, Value]) -> PartSpec:
    """Labelled vertices."""
    return WithLabelSpec(whole(entries["label"]))


def _near_bones(entries: Mapping[str, Value]) -> PartSpec:
    """Bones of the skeleton."""
    return NearBonesSpec(texts(entries["bones"], "bones"))


PARTS: Final[Mapping[str, Callable[[Mapping[str, Value]], PartSpec]]] = {
    "track, joint, radius": _near_track,
    "path": _own_mesh,
    "center, size": _in_box,
    "label": _with_label,
    "bones": _near_bones,
}
_KINDS: Final = tuple(PARTS)
KIND_OF: Final = {key: kind for kind in PARTS for key in kind.split(", ")}


def _check_bones(spec: SubjectSpec, at: Value) -> None:
    """Bones need a skeleton."""
    for name, part in spec.parts.items():
        if isinstance(part, NearBonesSpec) and spec.skeleton is None:
            key = f"{spec.key}.skeleton"
            raise Value(at.file, key, None).error(f'a BVH file, as the part "{name}" names bones')
