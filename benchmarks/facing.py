"""How good the estimated facing and gaze are, against the joint tracks of the shared data; prints a table.

Facing: per frame against the horizontal normal of hips and shoulders (both lines count the same). The joint tracks hold
no eyes and no direction of the face. So for the scenes the head is measured as far as it goes: the eyes' distance to
the joint Head and the angle between the estimated direction and the plane square to Head -> Head_end (nodding and
leaning; 0 is square). For the skinned motions the Head joint's rotation is the truth of the direction.
"""

import csv
import sys
import time
from collections import defaultdict
from pathlib import Path

import DracoPy
import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.sequences.bodies import track_body
from mhvedit.sequences.facing import facing_of_body
from mhvedit.sequences.gaze import gaze_of_body
from mhvedit.sequences.meshes import Gaze, Mesh, MeshSequence

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
Joints = dict[str, FloatArray]
HEADER = ["take", "frames", "median °", "95 % °", "worst °", "ms a frame (processor)"]
GAZE_HEADER = [*HEADER[:1], "face median °", "face 95 % °", "eyes to Head mm", "ms a frame (processor)"]


def read_scene_subject(folder: Path) -> tuple[MeshSequence, Joints]:
    """A subject of a shared scene, its meshes in memory, and its joints by name, (T, 3) m each."""
    meshes = {}
    for path in sorted(folder.glob("*.drc")):
        found = DracoPy.decode(path.read_bytes())
        meshes[int(path.stem.split("_")[-1])] = Mesh(
            np.asarray(found.points, np.float64), np.asarray(found.faces, np.int32).reshape(-1, 3)
        )
    places: dict[str, dict[int, list[float]]] = defaultdict(dict)
    with folder.with_suffix(".csv").open() as lines:
        for row in csv.DictReader(lines):
            places[row["joint"]][int(row["frame"])] = [float(row[axis]) for axis in "xyz"]
    joints = {name: np.array([at[number] for number in meshes]) for name, at in places.items()}
    return MeshSequence(folder.name, tuple(meshes), 25.0, meshes.__getitem__), joints


def read_motion(path: Path, *, stride: int = 2) -> tuple[MeshSequence, Joints, FloatArray]:
    """A skinned motion as meshes, its joints, and the true direction of the face (T, 3)."""
    z = np.load(path)
    names = [str(name) for name in z["joints"]]
    turns = _matrices(z["rotations"][::stride])
    shifts = z["positions"][::stride] - np.einsum("tjab,jb->tja", turns, z["rest"])

    def pose(frame: int) -> Mesh:
        blend = np.einsum("vj,jab->vab", z_weights, turns[frame])
        posed = np.einsum("vab,vb->va", blend, z_rest) + z_weights @ shifts[frame]
        return Mesh(posed, faces)

    z_weights, z_rest, faces = z["weights"], z["vertices"], z["faces"].astype(np.int32)
    meshes = {frame: pose(frame) for frame in range(len(turns))}
    joints = {name: z["positions"][::stride, j] for j, name in enumerate(names)}
    rest = {name: z["rest"][None, j] for j, name in enumerate(names)}
    yaw = float(true_facing(rest)[0])
    face = turns[:, names.index("Head")] @ np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return MeshSequence(path.stem, tuple(meshes), float(z["fps"]) / stride, meshes.__getitem__), joints, face


def _matrices(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices of (..., 4) xyzw."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def true_facing(joints: Joints) -> FloatArray:
    """Yaw (T,) rad of the horizontal normal of hips and shoulders."""
    across: FloatArray = np.zeros((len(joints["LeftArm"]), 2))
    for left, right in (("LeftUpLeg", "RightUpLeg"), ("LeftArm", "RightArm")):
        line = (joints[right] - joints[left])[:, :2]
        across = across + line / np.linalg.norm(line, axis=1, keepdims=True)
    return np.asarray(np.arctan2(across[:, 0], -across[:, 1]))


def face_error(gaze: Gaze, joints: Joints, face: FloatArray | None) -> FloatArray:
    """Degrees: between directions where the true one is known, else from the plane square to the head's axis."""
    if face is not None:
        return np.asarray(np.degrees(np.arccos(np.clip((gaze.direction * face).sum(1), -1, 1))))
    axis = joints["Head_end"] - joints["Head"]
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.divide(axis, length, out=np.full_like(axis, np.nan), where=length > 0)  # some tracks end at the Head
    return np.asarray(np.degrees(np.abs(np.arcsin(np.clip((gaze.direction * axis).sum(1), -1, 1)))))


def measure(
    name: str, sequence: MeshSequence, joints: Joints, face: FloatArray | None
) -> tuple[list[str], list[str], FloatArray]:
    """One row for the facing, one for the gaze, and the facing's errors in degrees."""
    began = time.process_time()
    body = track_body(sequence)
    facing = facing_of_body(body, fps=sequence.fps)
    middle = time.process_time()
    gaze = gaze_of_body(sequence, body)
    spent = 1e3 * np.diff([began, middle, time.process_time()]) / len(sequence.numbers)
    error = np.degrees(np.abs(wrap_angle(facing.yaw - true_facing(joints))))
    off = face_error(gaze, joints, face)
    eyes = np.median(np.linalg.norm(gaze.eye - joints["Head"], axis=1)) * 1e3
    figures = [f"{np.median(error):.1f}", f"{np.percentile(error, 95):.1f}", f"{error.max():.1f}", f"{spent[0]:.1f}"]
    known = np.isfinite(off).all()
    share = [f"{np.median(off):.1f}", f"{np.percentile(off, 95):.1f}"] if known else ["–", "–"]
    of_gaze = [*share, f"{eyes:.0f}", f"{spent[1]:.1f}"]
    return [name, str(len(error)), *figures], [name, *of_gaze], error


def print_table(header: list[str], rows: list[list[str]], *, markdown: bool) -> None:
    """Rows under a header, as Markdown or in columns."""
    if markdown:
        rows = [["---"] * len(header), *rows]
    for row in [header, *rows]:
        cells = [cell.ljust(26) if k == 0 and not markdown else cell.rjust(11) for k, cell in enumerate(row)]
        print("| " + " | ".join(cell.strip() for cell in row) + " |" if markdown else " ".join(cells))
    print()


def main() -> None:
    """All takes of the shared data; `--markdown` for docs/results.md, `--scenes` without the skinned motions."""
    markdown = "--markdown" in sys.argv
    facing_rows, gaze_rows, errors = [], [], []
    warm, joints = read_scene_subject(SHARED / "scenes" / "box_follow" / "a")
    track_body(MeshSequence("warm", warm.numbers[:1], 25.0, warm.load))  # compiles
    takes: list[tuple[str, MeshSequence, Joints, FloatArray | None]] = []
    for scene in sorted((SHARED / "scenes").iterdir()):
        takes += [(f"{scene.name} {subject}", *read_scene_subject(scene / subject), None) for subject in "ab"]
    if "--scenes" not in sys.argv:
        for path in sorted((SHARED / "motions").glob("*.npz")):
            takes.append((path.stem, *read_motion(path)))
    for name, sequence, joints, face in takes:
        row, of_gaze, error = measure(name, sequence, joints, face)
        facing_rows.append(row)
        gaze_rows.append(of_gaze)
        errors.append(error)
    every = np.concatenate(errors)
    summary = [f"{np.median(every):.1f}", f"{np.percentile(every, 95):.1f}", f"{every.max():.1f}", ""]
    facing_rows.append(["all", str(len(every)), *summary])
    print_table(HEADER, facing_rows, markdown=markdown)
    print_table(GAZE_HEADER, gaze_rows, markdown=markdown)


if __name__ == "__main__":
    main()
