"""Props of the set: an arm sweeps a ball off a table, through the whole job and into a .glb.

python examples/world_props.py      # writes out/props
"""

from pathlib import Path

import numpy as np
import trimesh

from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.pipeline.export import ExportSettings, export_output
from mhvedit.pipeline.run import run_scene
from mhvedit.scene.edit import read_edit

BODY = [[(-0.09, -0.17, 0.0), (0.1, 0.16, 0.85)], [(-0.1, -0.2, 0.83), (0.13, 0.2, 1.66)]]  # m, low and high corners
TABLE = [(0.3, -0.4, 1.0), (0.7, 0.1, 1.1)]
BALL, RADIUS = (0.45, -0.15, 1.2), 0.1  # m
SCENE = """\
version = 1
name = "sweep"
[subjects.anna]
path = "anna"
fps = 30
facing = 0
[subjects.ben]
path = "ben"
fps = 30
facing = 0
[[segments]]
name = "stand"
between = ["anna", "ben"]
frames = {anna = [0, 2], ben = [0, 2]}
interaction = "none"
visibility = false
[search]
voxel = 0.04
step = 0.04
yaw_step = 30
[stage]
pin = "anna"
[props.table]
path = "table.ply"
[props.ball]
path = "ball.ply"
class = "simulated"
mass = 0.5
"""


def main(out: Path = Path("out/props"), n_frames: int = 175) -> None:
    """Captures and props, the solve, and the export."""
    for name, speed in (("anna", 0.023), ("ben", 0.0)):  # m a frame
        (out / name).mkdir(parents=True, exist_ok=True)
        for frame in range(n_frames):
            arm = [(0.0, -0.19, 1.18), (0.22 + speed * min(max(frame - 5, 0), 15), -0.1, 1.27)]
            body = trimesh.util.concatenate([trimesh.creation.box(bounds=limb) for limb in (*BODY, arm)])
            body.export(out / name / f"{name}_{frame:04d}.ply")
    trimesh.creation.box(bounds=TABLE).export(out / "table.ply")
    ball = trimesh.creation.icosphere(3, RADIUS)
    ball.apply_translation(BALL)
    ball.export(out / "ball.ply")
    (out / "scene.toml").write_text(SCENE)
    run_scene(out / "scene.toml", out / "edited", check=False)
    export_output(out / "edited", out / "sweep.glb", ExportSettings(), force=True)
    placed = read_edit(out / "edited" / "edit.json").props["ball"]
    middles = rotation_matrices(placed.rotations) @ BALL + placed.positions
    down = int(np.argmax(middles[:, 2] < RADIUS + 0.001))
    print(f"on the floor from frame {down}, {middles[down, 0]:.2f} m from her, at the end {middles[-1, 0]:.2f} m")


if __name__ == "__main__":
    main()
