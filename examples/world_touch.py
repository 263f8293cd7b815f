"""Hands stop at props of the set: the free hand of a bundled fencer swings back into a wall.

python examples/world_touch.py      # writes out/touch, with a picture of before and after
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from mhvedit.geometry.arrays import ByteArray
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.pipeline.run import run_scene
from mhvedit.scene.edit import EditedScene, placed_mesh, read_edit
from mhvedit.sequences.meshes import Mesh
from mhvedit.sequences.read import open_capture
from mhvedit.view.renders import frame_picture
from mhvedit.view.studio import Camera

WALL = ((1.45, -0.3, 0.0), (1.6, 0.6, 1.5))  # m
SHOWN = (8, 13, 18, 24)  # frames of the scene
CAMERA = Camera(np.array([1.2, -2.5, 1.5]), np.array([1.15, 0.2, 0.95]), np.array([0.0, 0.0, 1.0]))
SUBJECT = """\
[subjects.{name}]
path = "{duel}/{name}"
frames = [36, {last}]
fps = 25
facing = "{duel}/{name}.csv"
"""
SCENE = """\
version = 1
name = "touch"
{subjects}
[[segments]]
name = "guard"
between = ["anna", "ben"]
frames = {{anna = [36, 38], ben = [36, 38]}}
interaction = "none"
visibility = false
[search]
voxel = 0.04
step = 0.12
yaw_step = 45
[stage]
pin = "anna"
marks = [{{subject = "ben", frame = 36, at = [-1.5, 1.0], within = 0.6}}]
[props.wall]
path = "wall.obj"
"""


def picture(edit: EditedScene, duel: Path) -> ByteArray:
    """Some frames side by side."""
    captures, wall = {"anna": open_capture(duel / "anna", name="anna")}, trimesh.creation.box(bounds=WALL)
    prop = Mesh(np.array(wall.vertices), np.array(wall.faces, np.int32))
    meshes = [placed_mesh(edit, captures, "anna", frame) for frame in SHOWN]
    drawn = [frame_picture({"anna": mesh}, props=[prop], view=CAMERA, size=(300, 400)) for mesh in meshes]
    return np.concatenate(drawn, axis=1)


def main(out: Path = Path("out/touch"), last: int = 72) -> None:
    """The wall, the solve, and what became of it."""
    duel = bundled_scene("scene").resolve().parent
    out.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(bounds=WALL).export(out / "wall.obj")
    subjects = "".join(SUBJECT.format(name=name, duel=duel, last=last) for name in ("anna", "ben"))
    (out / "scene.toml").write_text(SCENE.format(subjects=subjects))
    outcome = run_scene(out / "scene.toml", out / "edited", check=False)
    print(*(stop["sentence"] for stop in outcome.report.get("stops", ())), sep="\n")
    edit = read_edit(out / "edited" / "edit.json")
    plain = replace(edit, subjects={name: replace(own, touched=None) for name, own in edit.subjects.items()})
    Image.fromarray(np.concatenate([picture(each, duel) for each in (plain, edit)])).save(out / "touch.webp")


if __name__ == "__main__":
    main()
