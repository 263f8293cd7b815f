import os
import tomllib
from collections.abc import Callable
from math import pi
from pathlib import Path

import pytest

from mhvedit.errors import SceneError
from mhvedit.project.changes import Place, Setting, save_changes
from mhvedit.project.scene_file import load_scene

SceneWith = Callable[..., Path]


def test_no_change_to_the_last_byte(scene_with: SceneWith) -> None:
    path = scene_with()
    before = path.read_bytes()
    assert save_changes(path, {}) == load_scene(path)
    assert path.read_bytes() == before


def test_comments_and_layout_stay(scene_with: SceneWith) -> None:
    path = scene_with(("ben = [7, 9]}", "ben = [ 7,9 ]}   # they shake"))
    before = path.read_text()
    scene = save_changes(
        path,
        {
            ("name",): "greeting",
            ("subjects", "anna", "parts", "hand", "radius"): 0.2,
            ("segments", 1, "frames", "anna"): [6, 7],
            ("segments", 1, "frames", "ben", 0): 8,
        },
    )
    expected = (
        before.replace('"handshake"', '"greeting"')
        .replace("0.11}", "0.2}")
        .replace("[5, 7]", "[6, 7]")
        .replace("[ 7,9 ]", "[ 8,9 ]")
    )
    assert path.read_text() == expected
    assert scene == load_scene(path)
    assert scene.segments[1].frames == {"ben": range(8, 10), "anna": range(6, 8)}


def test_what_is_not_there_is_made(scene_with: SceneWith) -> None:
    path = scene_with(('"0&0a"', '"0&0a"\nvisibility = false  # too far'))
    scene = save_changes(
        path,
        {
            ("segments", 0, "visibility", "half_angle"): 50,
            ("segments", 1, "visibility", "half_angle"): 60,
            ("segments", 1, "tolerance"): {"frames": 2, "depth": 0.05},
            ("search", "yaw_step"): 4,
            ("optimise", "alpha"): 3.0,
        },
    )
    assert [segment.visibility and segment.visibility.half_angle for segment in scene.segments] == [
        pytest.approx(50 * pi / 180),
        pytest.approx(pi / 3),
    ]
    assert (scene.search.n_yaw, scene.optimise.alpha, scene.segments[1].tolerance.depth) == (90, 3.0, 0.05)
    content = path.read_text()
    assert "visibility = {half_angle = 60}  # too far\n" in content
    assert "# they hold\n[[segments]]" in content
    assert tomllib.loads(content)["segments"][1]["tolerance"] == {"frames": 2, "depth": 0.05}


def test_none_takes_a_value_out(scene_with: SceneWith) -> None:
    path = scene_with(('"0&0a"', '"0&0a"\nvisibility = {half_angle = 40, frames = [0, 1]}'))
    gone: dict[Place, Setting] = {("segments", 1, "visibility", "frames"): None, ("search", "voxel"): None}
    visibility = save_changes(path, gone).segments[1].visibility
    assert visibility is not None and visibility.frames is None
    assert "visibility = {half_angle = 40 }\n" in path.read_text()
    assert "search" not in path.read_text()


def test_none_takes_a_segment_out(scene_with: SceneWith) -> None:
    path = scene_with()
    assert [segment.name for segment in save_changes(path, {("segments", 0): None}).segments] == ["hold"]
    with pytest.raises(SceneError, match="segments: expected at least one"):
        save_changes(path, {("segments", 0): None})


def test_dotted_keys(scene_with: SceneWith) -> None:
    path = scene_with(("version = 1", "version = 1\nsearch.voxel = 0.005  # fine"))
    search = save_changes(path, {("search", "step"): 0.02, ("search", "window"): 3}).search
    assert (search.voxel, search.step, search.window) == (0.005, 0.02, 3.0)
    assert "search.voxel = 0.005  # fine\n" in path.read_text()


def test_tables_in_any_order(scene_with: SceneWith) -> None:
    path = scene_with(more='[subjects.carl]\npath = "ben"  # again\n')
    scene = save_changes(path, {("subjects", "carl", "up"): "y", ("subjects", "anna", "up"): "x"})
    assert [subject.up for subject in scene.subjects.values()] == ["x", "z", "y"]
    assert 'path = "ben"  # again\n' in path.read_text()


def test_new_keys_come_before_comments_on_what_follows(scene_with: SceneWith) -> None:
    path = scene_with(
        ("\n[subjects.anna]", "\n# she\n[subjects.anna]"), ('"ben"\n', '"ben"\n[subjects.ben.parts] # none\n\n')
    )
    before = path.read_text()
    zone: Setting = {"center": [0, 0, 1], "size": [1.0, 1, 1]}
    save_changes(
        path,
        {
            ("fps",): 25,
            ("subjects", "anna", "up"): "y",
            ("subjects", "ben", "parts", "a.b"): zone,
            ("segments", 0, "visibility"): {"half_angle": 50},
            ("segments", 1, "retime"): "floor",
        },
    )
    expected = (
        before.replace("# a greeting\n", "# a greeting\nfps = 25\n")
        .replace('path = "anna"\n', 'path = "anna"\nup = "y"\n')
        .replace("# none\n", '# none\n"a.b" = {center = [0, 0, 1], size = [1.0, 1, 1]}\n')
        .replace('"+&+"\n', '"+&+"\nvisibility = {half_angle = 50}\n')
    )
    assert path.read_text() == expected + 'retime = "floor"\n'


def test_no_line_end_at_the_end(scene_with: SceneWith) -> None:
    path = scene_with()
    path.write_text(path.read_text().rstrip())
    assert save_changes(path, {("segments", 1, "retime"): "floor"}).segments[1].retime == "floor"


def test_windows_line_ends_stay(scene_with: SceneWith) -> None:
    path = scene_with()
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    save_changes(path, {("name",): "x", ("fps",): 25, ("search", "voxel"): 0.02, ("search", "step"): 0.02})
    assert path.read_bytes().count(b"\n") == path.read_bytes().count(b"\r\n")


@pytest.mark.parametrize(
    ("place", "value", "expected"),
    [
        (("search", "voxel"), 0, "search.voxel: expected a number above 0, found 0"),
        (("segments", 1, "nme"), "x", 'segments[1] "hold".nme: expected one of name, '),
        (("segments", 2, "name"), "x", "segments[2].name: expected a place in the scene file, found "),
        (("name", "x"), "x", "name: expected a text, found "),
        (("segments", "first", "name"), "x", "segments.first.name: expected a place in the scene file, found "),
    ],
)
def test_what_would_not_load_is_not_written(scene_with: SceneWith, place: Place, value: Setting, expected: str) -> None:
    path = scene_with()
    before = path.read_bytes()
    with pytest.raises(SceneError) as error:
        save_changes(path, {("name",): "other", place: value})
    assert str(error.value).startswith(f"{path}: {expected}")
    assert path.read_bytes() == before


def test_a_scene_that_does_not_load_is_left_alone(scene_with: SceneWith) -> None:
    path = scene_with(("version = 1", "version = 2"))
    with pytest.raises(SceneError, match="version: expected 1, found 2"):
        save_changes(path, {("version",): 1})


def test_all_or_nothing(scene_with: SceneWith, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene_with()
    before, files = path.read_bytes(), sorted(path.parent.iterdir())

    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        save_changes(path, {("name",): "other"})
    assert path.read_bytes() == before
    assert sorted(path.parent.iterdir()) == files


def test_links_and_rights_stay(scene_with: SceneWith) -> None:
    path = scene_with()
    path.chmod(0o640)
    link = path.with_name("link.toml")
    link.symlink_to(path)
    save_changes(link, {("name",): "other"})
    assert link.is_symlink() and load_scene(path).name == "other"
    assert path.stat().st_mode & 0o777 == 0o640


def test_lists_of_tables_stay_in_one_line(scene_with: SceneWith) -> None:
    path = scene_with()
    exclude: Setting = [{"x": 1.5, "y": 0, "yaw": 90}, {"x": 1, "y": 2, "yaw": 3.5, "radius": 0.2}]
    scene = save_changes(
        path, {("segments", 0, "exclude"): exclude, ("segments", 0, "pin"): {"x": 1, "y": 2, "yaw": 3}}
    )
    assert "exclude = [{x = 1.5, y = 0, yaw = 90}, {x = 1, y = 2, yaw = 3.5, radius = 0.2}]" in path.read_text()
    assert [e.radius for e in scene.segments[0].exclude] == [None, 0.2] and scene.segments[0].pin is not None
    assert scene.segments[1].exclude == () and scene.segments[1].pin is None
