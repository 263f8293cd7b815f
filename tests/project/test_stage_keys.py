from collections.abc import Callable
from math import pi
from pathlib import Path

import pytest

from mhvedit.errors import SceneError
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import Mark, Spot, StageSpec

TETRA = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

SceneWith = Callable[..., Path]
STAGE = """
[stage]
floor = [[0, 0], [4, 0], [4, 3], [2, 3], [2, 2], [0, 2]]
pin = "anna"
[[stage.marks]]
subject = "ben"
frame = 12
at = [1, 2.5]
facing = 90
within = 0.2

[props.table]
path = "table.obj"
units = "cm"
up = "y"
class = "simulated"
material = "metal"
mass = 3
place = [1, -2, 180]
"""


@pytest.fixture
def staged(scene_with: SceneWith, folder: Path) -> Callable[[str], Path]:
    """Writes the scene with more behind it, and a table beside it."""
    (folder / "table.obj").write_text(TETRA)
    return lambda content: scene_with(more=content)


def test_a_stage_with_a_prop(staged: Callable[[str], Path]) -> None:
    path = staged(STAGE)
    scene = load_scene(path)
    mark = Mark("stage.marks[0]", "ben", 12, (1.0, 2.5), pi / 2, 0.2)
    assert scene.stage == StageSpec(((0, 0), (4, 0), (4, 3), (2, 3), (2, 2), (0, 2)), (mark,), "anna")
    table = scene.props["table"]
    assert (table.units, table.up, table.kind, table.material, table.mass) == ("cm", "y", "simulated", "metal", 3)
    assert table.place == Spot(1, -2, pi) and table.path.path == path.parent / "table.obj"


@pytest.mark.parametrize(("keys", "stops"), [("", True), ("stops = false", False), ("stops = true", True)])
def test_a_fixed_prop_stops_limbs_unless_it_is_told_not_to(
    staged: Callable[[str], Path], keys: str, stops: bool
) -> None:
    scene = load_scene(staged(f'[props.table]\npath = "table.obj"\n{keys}\n'))
    assert scene.props["table"].stops is stops


def test_without_a_stage(staged: Callable[[str], Path]) -> None:
    scene = load_scene(staged(""))
    assert scene.stage == StageSpec() and scene.props == {}


BAD: dict[str, tuple[tuple[str, str], str]] = {
    "few corners": (
        ("floor = [[0, 0], [4, 0], [4, 3], [2, 3], [2, 2], [0, 2]]", "floor = [[0, 0], [4, 0]]"),
        "stage.floor: expected at least three corners [x, y] of a polygon that does not cross itself, "
        "found [[0, 0], [4, 0]]",
    ),
    "crossed": (
        ("floor = [[0, 0], [4, 0], [4, 3], [2, 3], [2, 2], [0, 2]]", "floor = [[0, 0], [1, 1], [1, 0], [0, 1]]"),
        "stage.floor: expected at least three corners [x, y] of a polygon that does not cross itself, "
        "found the edges from corner 0 and from corner 2, which cross",
    ),
    "flat": (
        ("floor = [[0, 0], [4, 0], [4, 3], [2, 3], [2, 2], [0, 2]]", "floor = [[0, 0], [1, 1], [2, 2]]"),
        "stage.floor: expected at least three corners [x, y] of a polygon that does not cross itself, "
        "found corners on one line",
    ),
    "corner": (("[4, 0], ", "[4], "), "stage.floor[1]: expected a corner, [x, y], found [4]"),
    "pin": (('pin = "anna"', 'pin = "carl"'), 'stage.pin: expected one of anna, ben, found "carl"'),
    "marked and pinned": (
        ('subject = "ben"', 'subject = "anna"'),
        'stage.marks[0].subject: expected somebody who is not pinned, found "anna"',
    ),
    "within": (("within = 0.2", "within = -1"), "stage.marks[0].within: expected a number of at least 0, found -1"),
    "marked twice": (
        ("\n[props.table]", '\n[[stage.marks]]\nsubject = "ben"\nframe = 12\nat = [0, 0]\n[props.table]'),
        "stage.marks[1].frame: expected a frame of ben that no other mark has, found 12, as in stage.marks[0]",
    ),
    "class": (
        ('"simulated"', '"free"'),
        'props.table.class: expected one of fixed, simulated, driven, found "free"',
    ),
    "material": (('"metal"', '"glass"'), 'props.table.material: expected one of wood, metal, human, found "glass"'),
    "mass": (("mass = 3", "mass = 0"), "props.table.mass: expected a number above 0, found 0"),
    "less than nothing": (("mass = 3", "mass = -2"), "props.table.mass: expected a number above 0, found -2"),
    "moved": (
        ("mass = 3", 'motion = "table.obj"'),
        'props.table.motion: expected nothing, unless the class is "driven", found "table.obj"',
    ),
    "stops what moves": (
        ("mass = 3", "stops = true"),
        'props.table.stops: expected nothing, unless the class is "fixed", found true',
    ),
    "stops perhaps": (
        ('class = "simulated"', 'stops = "yes"'),
        'props.table.stops: expected true or false, found "yes"',
    ),
    "no motion there": (
        ('class = "simulated"', 'class = "driven"\nmotion = "box.bvh"'),
        "props.table.motion: expected a BVH file, found nothing at ",
    ),
    "name": (("[props.table]", "[props.ben]"), 'props.ben: expected a name that no subject has, found "ben"'),
    "unknown": (
        ("mass = 3", "weight = 3"),
        "props.table.weight: expected one of path, units, up, class, material, mass, place, motion, "
        "stops, found an unknown key",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_a_bad_stage(staged: Callable[[str], Path], what: str) -> None:
    (old, new), expected = BAD[what]
    assert old in STAGE
    path = staged(STAGE.replace(old, new))
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: {expected}")


def test_edges_on_one_line_need_not_cross(staged: Callable[[str], Path]) -> None:
    notch = "[[0, 0], [1, 0], [1, 1], [2, 1], [2, 0], [3, 0], [3, 2], [0, 2]]"
    scene = load_scene(staged(f"[stage]\nfloor = {notch}\n"))
    assert len(scene.stage.floor) == 8
