from pathlib import Path

import pytest

from mhvedit.batch.plan import scene_tasks
from mhvedit.batch.records import Inputs
from mhvedit.project.scene_file import load_scene
from mhvedit.sequences.contents import contents
from tests.pipeline.toy import write_scene


def keys(path: Path) -> set[str]:
    return {task.key for task in scene_tasks(load_scene(path))}


def test_the_tasks_of_a_scene_come_after_what_they_need(folder: Path) -> None:
    tasks = scene_tasks(load_scene(folder / "scene.toml"))
    assert [task.name for task in tasks] == ["anna", "ben", "raise", "lower"]
    assert tasks[2].needs == tasks[3].needs == (tasks[0].key, tasks[1].key)
    assert tasks[2].size == 60 * 60 * 24 * 7


@pytest.mark.parametrize(
    ("old", "new", "shared"),
    [
        ('name = "toy"', 'name = "play"', 4),
        ("window = 2.4", "window = 2.4\n[optimise]\nalpha = 5", 4),
        ('name = "lower"', 'name = "lower"\npin = {x = 0, y = 0, yaw = 0}', 4),
        ("half_angle = 60", "half_angle = 50", 3),
        ("window = 2.4", "window = 2.2", 2),
        ('name = "lower"', 'name = "lower"\nwindow = 2.2', 3),
        ('path = "ben"\nfps = 30', 'path = "ben"\nfps = 25', 1),
    ],
)
def test_what_scenes_share(folder: Path, old: str, new: str, shared: int) -> None:
    other = write_scene(folder, (old, new), name="other")
    assert len(keys(folder / "scene.toml") & keys(other)) == shared


def test_the_key_of_a_finished_scene_is_made_of_what_files_hold(folder: Path) -> None:
    def key(*options: object) -> str:
        return Inputs(contents(folder / "contents.json")).key(load_scene(folder / "scene.toml"), *options)

    before = key(True)
    assert key(True) == before and key(False) != before
    mesh = next((folder / "anna").iterdir())
    mesh.touch()
    assert key(True) == before
    mesh.write_text(mesh.read_text() + "# looks different\n")
    assert key(True) != before
