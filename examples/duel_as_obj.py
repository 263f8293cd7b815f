"""Writes some frames of the bundled duel as folders of OBJ files, centimetres and y up, as many tools write them.

    python examples/duel_as_obj.py      # makes mine/anna, mine/anna_sword, mine/ben, mine/ben_sword

The tutorial starts from these folders.
"""

from pathlib import Path

import numpy as np

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.sequences.axes import from_metres_z_up
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.volumes.parts import OwnMesh

FRAMES = range(72, 110)


def main(folder: Path = Path("mine")) -> None:
    """Both people and both swords."""
    for name, subject in api.load(bundled_scene("short")).subjects.items():
        write_objs(subject.sequence, folder / name)
        sword = subject.parts["sword"]
        assert isinstance(sword, OwnMesh)
        write_objs(sword.sequence, folder / f"{name}_sword")


def write_objs(capture: MeshSequence, folder: Path) -> None:
    """One OBJ file for each frame."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in FRAMES:
        mesh = capture.mesh(number)
        points = from_metres_z_up(mesh.vertices, units="cm", up="y")
        lines = ["v {:.4f} {:.4f} {:.4f}".format(*point) for point in points]
        lines += ["f {} {} {}".format(*face) for face in np.asarray(mesh.faces) + 1]
        (folder / f"{folder.name}_{number:04d}.obj").write_text("\n".join(lines) + "\n")
    print(f"{folder}: {len(FRAMES)} frames")


if __name__ == "__main__":
    main()
