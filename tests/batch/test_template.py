from pathlib import Path

import pytest

from mhvedit.batch.asked import SCENE, asked_scenes
from mhvedit.batch.template import made_scenes, read_template
from mhvedit.errors import SceneError
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import SceneFile

TEMPLATE = """\
scene = "scene.toml"
[parameters]
"segments.raise.interaction" = ["+&+", "-&-"]
"optimise.facing_weight" = [0.5, 1]
"""


def template(folder: Path, content: str = TEMPLATE) -> Path:
    (folder / "many.toml").write_text(content)
    return folder / "many.toml"


def made(path: Path, out: Path) -> dict[str, SceneFile]:
    """The scenes of a template, loaded."""
    scenes = {}
    for scene in asked_scenes([path], out):
        assert scene.content is not None and scene.file == out / scene.name / SCENE
        scene.file.parent.mkdir(parents=True)
        scene.file.write_text(scene.content)
        scenes[scene.name] = load_scene(scene.file)
    return scenes


def test_all_combinations(folder: Path, tmp_path: Path) -> None:
    scenes = made(template(folder), tmp_path / "out")
    assert list(scenes) == ["scene-pp-0.5", "scene-pp-1", "scene-mm-0.5", "scene-mm-1"]
    found = [(s.segments[0].interaction.value, s.optimise.facing_weight) for s in scenes.values()]
    assert found == [("+&+", 0.5), ("+&+", 1.0), ("-&-", 0.5), ("-&-", 1.0)]
    assert [scene.name for scene in scenes.values()] == list(scenes)


def test_paths_lead_where_they_led(folder: Path, tmp_path: Path) -> None:
    before = load_scene(folder / "scene.toml")
    for scene in made(template(folder), tmp_path / "elsewhere" / "out").values():
        for name, subject in scene.subjects.items():
            assert subject.path.path == before.subjects[name].path.path
            assert subject.gaze is not None and subject.gaze.eye.path == (folder / f"{name}.csv").resolve()


def test_several_places_at_once(folder: Path, tmp_path: Path) -> None:
    """Another capture has other tracks."""
    swap = '{"subjects.ben.path" = "anna", "subjects.ben.facing" = "anna.csv"}'
    content = f'scene = "scene.toml"\n[parameters]\ncast = [{{"subjects.ben.path" = "ben"}}, {swap}]\n'
    scenes = made(template(folder, content), tmp_path / "out")
    assert list(scenes) == ["scene-cast1", "scene-cast2"]
    assert [scene.subjects["ben"].path.path.name for scene in scenes.values()] == ["ben", "anna"]


def test_seeds_draw_the_same_again_and_each_its_own(folder: Path, tmp_path: Path) -> None:
    drawn = 'scene = "scene.toml"\nseeds = [3, 4]\n[parameters]\n"optimise.alpha" = {between = [5, 20]}\n'
    first, second = (made(template(folder, drawn), tmp_path / name) for name in ("one", "two"))
    assert list(first) == ["scene-seed3", "scene-seed4"]
    values = [scene.optimise.alpha for scene in first.values()]
    assert values == [scene.optimise.alpha for scene in second.values()]
    assert values[0] != values[1] and all(5 <= value <= 20 for value in values)
    more = drawn.replace("[parameters]", '[parameters]\n"search.window" = [2.4, 2.0]')
    assert {scene.optimise.alpha for scene in made(template(folder, more), tmp_path / "3").values()} == set(values)


def test_one_more_value_leaves_the_other_names(folder: Path, tmp_path: Path) -> None:
    before = made_scenes(read_template(template(folder)), tmp_path)
    more = made_scenes(read_template(template(folder, TEMPLATE.replace("[0.5, 1]", "[0.25, 0.5, 1]"))), tmp_path)
    assert before.items() <= more.items() and len(more) == 6


def test_names_that_would_be_the_same(folder: Path, tmp_path: Path) -> None:
    content = TEMPLATE.replace("[0.5, 1]", "[0.5, 1]\nlong = [{}, {fps = 30}]")
    content = content.replace('["+&+", "-&-"]', '["a/b", "c/b"]')
    names = list(made_scenes(read_template(template(folder, content)), tmp_path))
    assert len(set(names)) == 8 and all(name.startswith("scene-b-") and "/" not in name for name in names)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("segments.raise", "segments.rise", "one of raise, lower, found rise"),
        ("optimise.facing_weight", "subjects.carl.units", "one of anna, ben, found carl"),
        ("optimise.facing_weight", "search.voxel.deep", "a place in the scene file, found 0.04 on the way"),
        ("[0.5, 1]", "[]", "a list of values, or {between = [low, high]}"),
        ("[0.5, 1]", "{between = [2, 1]}", "[low, high], low <= high"),
        ("[0.5, 1]", "{between = [1, 2]}", "seeds where a parameter is drawn between two numbers"),
        ("[parameters]", "seeds = [1]\n[parameters]", "seeds where a parameter is drawn between two numbers"),
        ("[parameters]", "[parameter]", "an unknown key (did you mean"),
        ('"scene.toml"', '"nobody.toml"', "a scene file, found nothing at"),
        ("[parameters]", "solutions = 0\n[parameters]", "a whole number of at least 1"),
        ("[0.5, 1]", f"{list(range(60000))}", "at most 100,000 scenes, found combinations for 120,000"),
    ],
)
def test_a_bad_template_is_one_sentence(folder: Path, tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(SceneError) as fault:
        asked_scenes([template(folder, TEMPLATE.replace(old, new))], tmp_path / "out")
    assert said in str(fault.value) and "\n" not in str(fault.value) and "many.toml" in str(fault.value)
    assert not (tmp_path / "out").exists()


def test_scenes_of_one_name_are_called_after_their_folders(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.toml").write_text("")
    asked = asked_scenes([tmp_path / "one", tmp_path / "two" / "scene.toml", tmp_path / "one"], tmp_path / "out")
    assert [scene.name for scene in asked] == ["one-scene", "two-scene"]


def test_an_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="scene files or templates"):
        asked_scenes([tmp_path], tmp_path / "out")
