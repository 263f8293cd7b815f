from dataclasses import replace
from pathlib import Path

import pytest

from mhvedit import api
from mhvedit.errors import SceneError
from mhvedit.project.changes import save_changes
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import Exclusion, Spot, Tolerance
from mhvedit.viewer.decisions import Decision, Decisions, changes_for, decided, decisions_of
from tests.pipeline.toy import RAISE_TABLE, write_scene

HERE = Spot(0.5, -1.25, 0.75)
OTHER = Decision(
    HERE,
    (Exclusion(HERE, None), Exclusion(HERE, 0.2, 0.5), Exclusion(HERE, 0.3)),
    0.9,
    Tolerance(3, 1.5, 0.05, 0.01),
)


def saved(scene: Path, decisions: Decisions) -> dict[str, Decision]:
    """What a scene file says after decisions were saved into it."""
    save_changes(scene, changes_for(load_scene(scene), api.load(scene).scene, decisions))
    return decisions_of(api.load(scene).scene)


def assert_same(there: Decision, wanted: Decision) -> None:
    """To the digits that are written."""
    assert there.tolerance == wanted.tolerance
    assert (there.half_angle is None) == (wanted.half_angle is None)
    assert there.half_angle == pytest.approx(wanted.half_angle, abs=1e-4)
    spots = [there.pin, *(e.at for e in there.exclude)], [wanted.pin, *(e.at for e in wanted.exclude)]
    for a, b in zip(*spots, strict=True):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            assert (a.x, a.y, a.yaw) == pytest.approx((b.x, b.y, b.yaw), abs=2e-4)
    for first, second in zip(there.exclude, wanted.exclude, strict=True):
        assert (first.radius, first.of_a) == (second.radius, second.of_a)
        assert first.turn == pytest.approx(second.turn, abs=1e-4)


def test_nothing_decided_is_nothing_to_write(folder: Path) -> None:
    scene = folder / "scene.toml"
    before = scene.read_bytes()
    assert changes_for(load_scene(scene), api.load(scene).scene, decisions_of(load_scene(scene))) == {}
    saved(scene, decisions_of(load_scene(scene)))
    assert scene.read_bytes() == before


def test_what_is_saved_is_read_again_and_comments_stay(folder: Path) -> None:
    scene = write_scene(folder, ("visibility = false", "visibility = false  # they look away"))
    first = decisions_of(load_scene(scene))
    there = saved(scene, {**first, "raise": OTHER})
    assert_same(there["raise"], OTHER)
    assert there["lower"] == first["lower"]
    assert "# they look away" in scene.read_text()


def test_taking_everything_back_leaves_no_trace(folder: Path) -> None:
    scene = folder / "scene.toml"
    first, before = decisions_of(load_scene(scene)), scene.read_text()
    saved(scene, {**first, "raise": replace(first["raise"], pin=HERE, exclude=OTHER.exclude)})
    assert scene.read_text() != before
    saved(scene, first)
    assert scene.read_text() == before


def test_no_cone_is_written_as_false(folder: Path) -> None:
    scene = folder / "scene.toml"
    first = decisions_of(load_scene(scene))
    assert saved(scene, {**first, "raise": replace(first["raise"], half_angle=None)})["raise"].half_angle is None
    assert_same(saved(scene, {**first, "lower": replace(first["lower"], half_angle=0.5)})["raise"], first["raise"])


def test_a_segment_told_from_the_other_side_keeps_its_meaning(folder: Path) -> None:
    other_side = RAISE_TABLE.replace("raise", "again").replace('["anna", "ben"]', '["ben", "anna"]')
    other_side = other_side.replace("[0, 6]", "[7, 8]")
    scene = write_scene(folder, (RAISE_TABLE, RAISE_TABLE + other_side))
    first = decisions_of(api.load(scene).scene)
    # a file can only speak of its own B: A, told from the scene's side
    wanted = replace(OTHER, exclude=tuple(replace(e, of_a=True) for e in OTHER.exclude))
    assert_same(saved(scene, {**first, "again": wanted})["again"], wanted)
    assert "exclude" not in scene.read_text().split('name = "again"')[0]


def test_a_segment_that_is_gone(folder: Path) -> None:
    scene = folder / "scene.toml"
    told = load_scene(scene)
    write_scene(folder, ('name = "lower"', 'name = "down"'))
    with pytest.raises(SceneError, match='expected the segment "lower", which was there, found raise, down'):
        changes_for(load_scene(scene), told, decisions_of(told))


def test_a_scene_as_decided(folder: Path) -> None:
    scene = load_scene(folder / "scene.toml")
    other = decided(scene, {**decisions_of(scene), "lower": OTHER})
    assert decisions_of(other)["lower"] == OTHER and other.segments[0] == scene.segments[0]
