"""A toy scene with props: an arm sweeps a ball off a table."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from mhvedit.geometry.arrays import FloatArray
from tests.pipeline.toy import BEN, CORNERS, FACES, Actor, obj_text, write_actor

N_FRAMES = 175
RADIUS = 0.1  # m
TABLE = ((0.3, -0.4, 1.0), (0.7, 0.1, 1.1))  # m
TOP = TABLE[1][2]
CONTENT = """\
version = 1
name = "sweep"

[subjects.anna]
path = "anna"
fps = 30
facing = "anna.csv"

[subjects.ben]
path = "ben"
fps = 30
facing = "ben.csv"

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
window = 2.4

[stage]
pin = "anna"
[[stage.marks]]
subject = "ben"
frame = 0
at = [-0.9, 0.0]
within = 0.3
"""
TABLE_KEYS = '[props.table]\npath = "table.obj"\n'
BALL_KEYS = '[props.ball]\npath = "ball.obj"\nclass = "simulated"\nmass = 0.5\nplace = [0.45, -0.15, 0]\n'


@dataclass(frozen=True, slots=True)
class Sweeper(Actor):
    """Stretches the arm out from frame 5 to frame 20, and keeps it there."""

    def hand(self, frame: int) -> FloatArray:
        share = np.clip((frame - 5) / 15, 0.0, 1.0)
        return np.array([0.22 + (self.long - 0.22) * share, self.side, 1.23])


def write_sweep(folder: Path, props: str = TABLE_KEYS + BALL_KEYS, *, n_frames: int = N_FRAMES) -> Path:
    """Write captures, props and the scene file."""
    folder.mkdir(exist_ok=True)
    write_actor(folder, "anna", Sweeper(long=0.56, numbers=range(n_frames)))
    write_actor(folder, "ben", Actor(long=0.22, place=BEN.place, numbers=range(n_frames)))
    low, high = np.array(TABLE)
    (folder / "table.obj").write_text(obj_text((low + CORNERS * (high - low), FACES)))
    write_ball(folder / "ball.obj", height=TOP + RADIUS)
    path = folder / "scene.toml"
    path.write_text(CONTENT + props)
    return path


def write_ball(path: Path, *, height: float) -> None:
    """A ball whose middle is at a height."""
    mesh = trimesh.creation.icosphere(3, RADIUS)
    path.write_text(obj_text((np.asarray(mesh.vertices) + np.array([0, 0, height]), np.asarray(mesh.faces))))
