from collections.abc import Callable
from pathlib import Path

import pytest

SCENE = """\
version = 1
name = "handshake"  # a greeting

[subjects.anna]
path = "anna"
[subjects.anna.parts]
hand = {track = "anna.csv", joint = "hand", radius = 0.11}  # the right one

[subjects.ben]
path = "ben"

[[segments]]
name = "raise"
between = ["anna", "ben"]
frames = {anna = [0, 4], ben = [2, 5]}
interaction = "+&+"

# they hold
[[segments]]
name = "hold"
between = ["ben", "anna"]
frames = {anna = [5, 7], ben = [7, 9]}
interaction = "0&0a"
"""
FRAMES = 10
TETRA = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write_capture(folder: Path, numbers: range) -> None:
    folder.mkdir()
    for number in numbers:
        (folder / f"body_{number:03}.obj").write_text(TETRA)


def write_track(file: Path, joints: tuple[str, ...], numbers: range) -> None:
    rows = [f"{number},{joint},0.1,0.2,1.{number}" for number in numbers for joint in joints]
    file.write_text("\n".join(["frame,joint,x,y,z", *rows]) + "\n")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene's folder with two captures of ten frames and a track."""
    write_capture(tmp_path / "anna", range(FRAMES))
    write_capture(tmp_path / "ben", range(FRAMES))
    write_track(tmp_path / "anna.csv", ("hand", "elbow"), range(FRAMES))
    return tmp_path


@pytest.fixture
def scene_with(folder: Path) -> Callable[..., Path]:
    """Writes the scene with some of its text replaced, and some more behind it."""

    def write(*replacements: tuple[str, str], more: str = "") -> Path:
        content = SCENE
        for old, new in replacements:
            assert old in content, old
            content = content.replace(old, new, 1)
        (folder / "scene.toml").write_text(content + more)
        return folder / "scene.toml"

    return write
