"""Two people made of boxes, captured apart: each stretches the right arm out, holds it, and takes it back."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray

N_FRAMES = 16
RAISE, LOWER = (0, 6), (9, 15)  # inclusive; in frames 7 and 8 the arm is stretched out
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
QUADS = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
FACES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])
Body = tuple[FloatArray, IntArray]
Limb = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]  # low and high along x, y, z
TORSO: tuple[Limb, ...] = (
    ((-0.11, 0.13), (-0.21, 0.19), (0.83, 1.41)),
    ((-0.09, 0.10), (-0.17, 0.16), (0.001, 0.85)),
    ((-0.10, 0.12), (-0.09, 0.08), (1.40, 1.66)),
    ((0.11, 0.15), (-0.02, 0.02), (1.50, 1.54)),  # nose
)

SCENE = """\
version = 1
name = "toy"

[subjects.anna]
path = "anna"
fps = 30
facing = "anna.csv"
gaze = {eye = "anna.csv", target = "anna.csv"}
[subjects.anna.parts]
hand = {track = "anna.csv", joint = "hand", radius = 0.12}

[subjects.ben]
path = "ben"
fps = 30
facing = "ben.csv"
gaze = {eye = "ben.csv", target = "ben.csv"}
[subjects.ben.parts]
hand = {track = "ben.csv", joint = "hand", radius = 0.12}

[[segments]]
name = "raise"
between = ["anna", "ben"]
frames = {anna = [0, 6], ben = [0, 6]}
interaction = "+&+"
parts = {anna = "hand", ben = "hand"}
visibility = {half_angle = 60}
tolerance = {frames = 1, voxels = 1, depth = 0.06, apart = 0.02}

[[segments]]
name = "lower"
between = ["anna", "ben"]
frames = {anna = [9, 15], ben = [9, 15]}
interaction = "-&-"
parts = {anna = "hand", ben = "hand"}
visibility = false
tolerance = {frames = 1, voxels = 1, depth = 0.06, apart = 0.02}

[search]
voxel = 0.04
step = 0.04
yaw_step = 15
window = 2.4
"""
RAISE_TABLE = SCENE[SCENE.index('[[segments]]\nname = "raise"') : SCENE.index('[[segments]]\nname = "lower"')]
LOWER_TABLE = SCENE[SCENE.index('[[segments]]\nname = "lower"') : SCENE.index("[search]")]


def reach_at(frame: int) -> float:
    """How far the hand is stretched out, 0 to 1."""
    first, last = RAISE[1], LOWER[0]
    if frame < first:
        return frame / first
    return 1.0 if frame <= last else 1.0 - (frame - last) / (LOWER[1] - last)


@dataclass(frozen=True, slots=True)
class Actor:
    """One of the two, and how the capture stands in its own world."""

    long: float  # m, of the arm at full stretch
    side: float = -0.15  # m, of the arm
    left: float = 0.45  # m, of the other arm, which is used from `left_from` on
    left_from: int = N_FRAMES
    walk: tuple[float, float] = (0.0, 0.0)  # m a frame
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x, y m and yaw rad in the capture
    numbers: range = field(default_factory=lambda: range(N_FRAMES))

    def hand(self, frame: int) -> FloatArray:
        """Tip of the hand, before it is placed."""
        side = self.left if frame >= self.left_from else self.side
        return np.array([0.22 + (self.long - 0.22) * reach_at(frame), side, 1.23])

    def body(self, frame: int) -> Body:
        """The mesh of a frame, placed."""
        tip, y, z = self.hand(frame)
        arm = ((0.0, tip), (y - 0.043, y + 0.047), (z - 0.05, z + 0.04))
        limbs = [np.array(limb) for limb in (*TORSO, arm)]
        vertices = np.concatenate([limb[:, 0] + CORNERS * (limb[:, 1] - limb[:, 0]) for limb in limbs])
        faces = np.concatenate([FACES + 8 * i for i in range(len(limbs))])
        return self.placed(vertices, frame), faces

    def placed(self, points: FloatArray, frame: int) -> FloatArray:
        """Points of a frame in the capture's world."""
        x, y, yaw = self.place
        walked = points + np.array([*np.multiply(self.walk, frame), 0.0])
        return np.asarray(turned(walked, yaw) + np.array([x, y, 0.0]))

    def track(self) -> str:
        """The CSV of hand, eye, target and facing."""
        rows = ["frame,joint,x,y,z"]
        for number in self.numbers:
            hand, eye, target = self.placed(
                np.array([self.hand(number) - [0.05, 0, 0], [0.12, 0, 1.55], [1.12, 0, 1.4]]), number
            )
            facing = turned(np.array([[1.0, 0.0, 0.0]]), self.place[2])[0]
            for joint, at in (("hand", hand), ("eye", eye), ("target", target), ("facing", facing)):
                rows.append(f"{number},{joint}," + ",".join(repr(float(v)) for v in at))
        return "\n".join(rows) + "\n"


ANNA = Actor(long=0.56, place=(0.3, -0.2, 0.4))
BEN = Actor(long=0.51, place=(-1.0, 2.0, -1.1))


def turned(points: FloatArray, yaw: float) -> FloatArray:
    """Points turned about z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.asarray(points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))


def obj_text(body: Body) -> str:
    """A mesh as OBJ, to the last bit."""
    vertices, faces = body
    lines = ["v " + " ".join(repr(float(x)) for x in v) for v in vertices]
    return "\n".join(lines + ["f " + " ".join(str(i + 1) for i in f) for f in faces]) + "\n"


def ply_text(body: Body) -> str:
    """A mesh as PLY, to the last bit."""
    vertices, faces = body
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = [" ".join(repr(float(x)) for x in v) for v in vertices] + [f"3 {a} {b} {c}" for a, b, c in faces]
    return head + "\n".join(rows) + "\n"


WRITERS: Mapping[str, Callable[[Body], str]] = {"obj": obj_text, "ply": ply_text}


def write_actor(folder: Path, name: str, actor: Actor, *, kind: str = "obj", scale: float = 1.0) -> None:
    """Write the capture and the track of one actor."""
    bodies = [actor.body(number) for number in actor.numbers]
    (folder / f"{name}.csv").write_text(actor.track())
    if kind == "npz":
        np.savez(
            folder / f"{name}.npz",
            vertices=np.concatenate([v * scale for v, _ in bodies]),
            faces=np.concatenate([f for _, f in bodies]),
            vertex_counts=[len(v) for v, _ in bodies],
            face_counts=[len(f) for _, f in bodies],
            fps=30.0,
            frame_numbers=np.array(actor.numbers),
        )
        return
    (folder / name).mkdir()
    for number, (vertices, faces) in zip(actor.numbers, bodies, strict=True):
        (folder / name / f"{name}_{number:04}.{kind}").write_text(WRITERS[kind]((vertices * scale, faces)))


def write_scene(folder: Path, *changes: tuple[str, str], content: str = SCENE, name: str = "scene") -> Path:
    """Write the scene file with some of its text replaced."""
    for old, new in changes:
        assert old in content, old
        content = content.replace(old, new)
    path = folder / f"{name}.toml"
    path.write_text(content)
    return path


@dataclass(frozen=True, slots=True)
class Ran:
    """What a command came to."""

    code: int
    out: str
    err: str

    @property
    def sentence(self) -> str:
        """The one line that it says on stderr."""
        assert self.err.startswith("mhvedit: ") and self.err.count("\n") == 1, self.err
        return self.err.removeprefix("mhvedit: ").rstrip("\n")


def files_of(out: Path) -> dict[str, bytes]:
    """What a person sees in an output folder."""
    if not out.exists():
        return {}
    names = {p.relative_to(out) for p in out.rglob("*") if p.is_file()}
    return {str(n): (out / n).read_bytes() for n in names if not any(part.startswith(".") for part in n.parts)}
