"""Brings an edited scene into Blender 4: set OUT, then run this inside Blender (Scripting tab, or `blender -P`).

Captures are folders of .obj, .ply, .stl or .glb; for others, `mhvedit export OUT --to scene.glb`, and open that.
"""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

OUT = Path("out/demo")  # output folder of `mhvedit solve`
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
TURNS = {"z": np.eye(3), "y": np.eye(3)[[0, 2, 1]] * [[1], [-1], [1]], "x": np.eye(3)[[2, 1, 0]] * [[-1], [1], [1]]}
IMPORTS = {".obj": "obj_import", ".ply": "ply_import", ".stl": "stl_import", ".glb": "gltf"}


def captures_of(out: Path) -> dict[str, tuple[list[Path], str, str]]:
    """Folders of each subject's body and of what it holds, units and up axis, as the scene file says."""
    scene, found = (out / json.loads((out / "scene.json").read_text())["scene"]).resolve(), {}
    for name, subject in tomllib.loads(scene.read_text())["subjects"].items():
        pieces = [subject, *(part for part in subject.get("parts", {}).values() if "path" in part)]
        folders = [scene.parent / piece["path"] for piece in pieces]
        found[name] = folders, subject.get("units", "m"), subject.get("up", "z")
    return found


def captured_files(folder: Path) -> dict[int, Path]:
    """Mesh files by frame number, which is the last run of digits in the name."""
    files = [file for file in folder.glob("*[0-9]*.*") if file.suffix.lower() in IMPORTS]
    return {int(re.findall(r"\d+", file.stem)[-1]): file for file in files}


def seen_keys(source: list[int]) -> dict[int, list[tuple[int, bool]]]:
    """For each captured frame the frames of the scene from which on it is seen, or not."""
    keys = {number: [] if number == source[0] else [(0, False)] for number in source}
    for frame, number in enumerate(source):
        if frame == 0 or number != source[frame - 1]:
            keys[number].append((frame, True))
            if frame:
                keys[source[frame - 1]].append((frame, False))
    return keys


def to_metres_z_up(units: str, up: str, *, kind: str) -> list[list[float]]:
    """(4, 4) from what Blender makes of a file; columns multiply. Blender takes a .glb for y up."""
    matrix = np.eye(4)
    matrix[:3, :3] = METRES[units] * TURNS[up] @ TURNS["y" if kind == ".glb" else "z"].T
    return matrix.tolist()


def main() -> None:
    """Build the scene: captured frames seen in their turn, on an empty that stands where the subject stands."""
    import bpy

    edit, scene = json.loads((OUT / "edit.json").read_text()), bpy.context.scene
    scene.frame_start, scene.frame_end = 0, edit["frames"] - 1
    scene.render.fps, scene.render.fps_base = round(edit["fps"]), round(edit["fps"]) / edit["fps"]
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "CONSTANT"  # nothing is made between frames
    for name, (folders, units, up) in captures_of(OUT).items():
        subject, stand = edit["subjects"][name], bpy.data.objects.new(name, None)
        scene.collection.objects.link(stand)
        for frame, (x, y, yaw) in enumerate(zip(subject["x"], subject["y"], subject["yaw"], strict=True)):
            _key(stand, frame, location=(x, y, 0.0), rotation_euler=(0.0, 0.0, yaw))
        for files in map(captured_files, folders):
            for number, keys in seen_keys(subject["source"]).items():
                for thing in _imported(bpy, files[number], stand, units, up):
                    for frame, seen in keys:
                        _key(thing, frame, hide_viewport=not seen, hide_render=not seen)


def _imported(bpy: Any, file: Path, stand: Any, units: str, up: str) -> set[Any]:  # noqa: ANN401 - Blender's own
    """The objects of a mesh file, hung on the stand."""
    from mathutils import Matrix

    kind, before = file.suffix.lower(), set(bpy.data.objects)
    group, axes = (bpy.ops.import_scene, {}) if kind == ".glb" else (bpy.ops.wm, {"forward_axis": "Y", "up_axis": "Z"})
    getattr(group, IMPORTS[kind])(filepath=str(file), **axes)
    for thing in set(bpy.data.objects) - before:
        if thing.parent is None:
            thing.parent = stand
            thing.matrix_basis = Matrix(to_metres_z_up(units, up, kind=kind)) @ thing.matrix_basis
    return set(bpy.data.objects) - before


def _key(thing: Any, frame: int, **values: Any) -> None:  # noqa: ANN401 - Blender's own
    """Set properties of an object in a frame."""
    for name, value in values.items():
        setattr(thing, name, value)
        thing.keyframe_insert(name, frame=frame)


if __name__ == "__main__":
    main()
