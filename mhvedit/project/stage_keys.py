"""The `[stage]` and `[props.<name>]` tables of a scene file."""

import math
from collections.abc import Collection, Mapping
from itertools import combinations, pairwise
from typing import Any, Final

from mhvedit.project.schema import Mark, MotionSpec, PropSpec, Spot, StageSpec, SubjectSpec
from mhvedit.project.values import Value, fields, file_path, name, named, number, one_of, shown, text, triple, whole
from mhvedit.sequences.axes import METRES, UP_AXES

STAGE: Final[Mapping[str, Any]] = {"floor": None, "marks": [], "pin": None}
MARK: Final[Mapping[str, Any]] = {"subject": None, "frame": None, "at": None, "facing": None, "within": 0.05}
PROP: Final[Mapping[str, Any]] = {
    "path": None,
    "units": "m",
    "up": "z",
    "class": "fixed",
    "material": "wood",
    "mass": None,
    "place": [0, 0, 0],
    "motion": None,
    "stops": None,
}
MOTION: Final[Mapping[str, Any]] = {"path": None, "joint": None, "units": None, "up": None}
CLASSES: Final = ("fixed", "simulated", "driven")
MATERIALS: Final = ("wood", "metal", "human")
CORNERS: Final = "at least three corners [x, y] of a polygon that does not cross itself"
Point = tuple[float, float]


def stage_spec(at: Value, subjects: Collection[str]) -> StageSpec:
    """The stage, checked.

    Args:
        at: its table.
        subjects: their names.

    Raises:
        SceneError: naming the key, what was expected and what is there.
    """
    entries = fields(at, STAGE)
    pin = None if entries["pin"].value is None else one_of(entries["pin"], subjects)
    marks = entries["marks"]
    if not isinstance(marks.value, list):
        raise marks.error("[[stage.marks]]")
    found = tuple(_mark(marks.at(i, value), subjects, pin) for i, value in enumerate(marks.value))
    for one, other in combinations(found, 2):
        if (one.subject, one.frame) == (other.subject, other.frame):
            raise Value(at.file, f"{other.key}.frame", other.frame).error(
                f"a frame of {other.subject} that no other mark has", f"{other.frame}, as in {one.key}"
            )
    return StageSpec(_floor(entries["floor"]), found, pin)


def prop_specs(at: Value, subjects: Mapping[str, SubjectSpec]) -> dict[str, PropSpec]:
    """All props, checked.

    Args:
        at: the table of their tables.
        subjects: whose names props cannot have.

    Raises:
        SceneError: naming the key, what was expected and what is there.
    """
    for known_as, entry in named(at).items():
        if known_as in subjects:
            raise entry.error("a name that no subject has", shown(known_as))
    return {known_as: _prop(entry, known_as) for known_as, entry in named(at).items()}


def _mark(at: Value, subjects: Collection[str], pin: str | None) -> Mark:
    """One mark."""
    entries = fields(at, MARK)
    subject, facing = one_of(entries["subject"], subjects), entries["facing"]
    if subject == pin:
        raise entries["subject"].error("somebody who is not pinned")
    return Mark(
        key=at.key,
        subject=subject,
        frame=whole(entries["frame"]),
        at=_point(entries["at"], "a place, [x, y]"),
        facing=None if facing.value is None else math.radians(number(facing)),
        within=number(entries["within"], least=0),
    )


def _prop(at: Value, known_as: str) -> PropSpec:
    """One prop."""
    entries = fields(at, PROP)
    x, y, yaw = triple(entries["place"])
    mass = entries["mass"]
    return PropSpec(
        key=at.key,
        name=name(Value(at.file, at.key, known_as)),
        path=file_path(entries["path"], "a mesh file, or a folder of numbered meshes", folder_too=True),
        units=one_of(entries["units"], METRES),
        up=one_of(entries["up"], UP_AXES),
        kind=one_of(entries["class"], CLASSES),
        material=one_of(entries["material"], MATERIALS),
        mass=None if mass.value is None else number(mass, above=0),
        place=Spot(x, y, math.radians(yaw)),
        motion=None if entries["motion"].value is None else _motion(entries["motion"], entries),
        stops=_stops(entries["stops"], entries["class"]),
    )


def _stops(at: Value, kind: Value) -> bool:
    """Whether limbs stop at a prop: at fixed ones, unless that is turned off."""
    if at.value is None:
        return True
    if kind.value != "fixed":
        raise at.error('nothing, unless the class is "fixed"')
    if not isinstance(at.value, bool):
        raise at.error("true or false")
    return at.value


def _motion(at: Value, prop: Mapping[str, Value]) -> MotionSpec:
    """A recorded motion: a file, or a table that also names the joint, units and axis; the prop's if it does not."""
    if prop["class"].value != "driven":
        raise at.error('nothing, unless the class is "driven"')
    entries = fields(at if isinstance(at.value, dict) else Value(at.file, at.key, {"path": at.value}), MOTION)
    units, up = (entries[key] if entries[key].value is not None else prop[key] for key in ("units", "up"))
    joint = entries["joint"]
    path = entries["path"] if isinstance(at.value, dict) else at
    return MotionSpec(
        path=file_path(path, "a BVH file"),
        joint=None if joint.value is None else text(joint, "the name of a joint"),
        units=one_of(units, METRES),
        up=one_of(up, UP_AXES),
    )


def _floor(at: Value) -> tuple[Point, ...]:
    """Corners of a simple polygon; none where there is no floor."""
    if at.value is None:
        return ()
    if not isinstance(at.value, list) or len(at.value) < 3:
        raise at.error(CORNERS)
    corners = tuple(_point(at.at(i, value), "a corner, [x, y]") for i, value in enumerate(at.value))
    edges = list(pairwise((*corners, corners[0])))
    for (i, one), (j, other) in combinations(enumerate(edges), 2):
        if j - i not in (1, len(edges) - 1) and _cross(one, other):
            raise at.error(CORNERS, f"the edges from corner {i} and from corner {j}, which cross")
    if not any(_side(corners[0], corners[1], corner) for corner in corners):
        raise at.error(CORNERS, "corners on one line")
    return corners


def _point(at: Value, expected: str) -> Point:
    """A place in plan, m."""
    if not isinstance(at.value, list) or len(at.value) != 2:
        raise at.error(expected)
    x, y = (number(at.at(i, value)) for i, value in enumerate(at.value))
    return x, y


def _cross(one: tuple[Point, Point], other: tuple[Point, Point]) -> bool:
    """Whether two edges have a point in common."""
    (a, b), (c, d) = one, other
    for i in (0, 1):
        if max(a[i], b[i]) < min(c[i], d[i]) or max(c[i], d[i]) < min(a[i], b[i]):
            return False
    return _side(a, b, c) * _side(a, b, d) <= 0 and _side(c, d, a) * _side(c, d, b) <= 0


def _side(a: Point, b: Point, c: Point) -> float:
    """On which side of the line from a to b a point is: the sign of the triangle's area."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
