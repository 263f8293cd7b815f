"""Edits made by hand, over the shared scenes and over small captures of every kind."""

import json
import tomllib
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mhvedit.export.content import ExportScene, Piece
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.edit import EditedScene, SubjectEdit, edit_as_dict
from mhvedit.sequences.meshes import BODY, Mesh, MeshSequence
from mhvedit.sequences.read import open_capture

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "scenes"
SHARED_SCENES = ("greeting", "pushup_grab", "salsa_open", "box_follow", "crawl_out")


def shared_scene(name: str, *, most: int | None) -> ExportScene:
    """A shared scene: A's frames in their order, B's at another speed, some twice; everybody walks a curve."""
    spec = tomllib.loads((SHARED / name / "scene.toml").read_text())["subjects"]
    captures = {n: open_capture(SHARED / name / n, name=n, fps=spec[n]["fps"]) for n in "ab"}
    n = min(most or 10**6, *(len(c.numbers) for c in captures.values()))
    rows = {"a": np.arange(n), "b": np.floor(np.arange(n) * 0.8).astype(int)}
    subjects = {
        who: SubjectEdit(np.array(captures[who].numbers)[rows[who]], curve(n, phase))
        for who, phase in (("a", 0.3), ("b", 2.9))
    }
    edit = EditedScene(name, 25.0, n, subjects, (), 0.0, 0.0, 0.0)
    pieces = tuple(Piece(w, BODY, w, c, SHARED / name / w, "m", "z") for w, c in captures.items())
    return ExportScene(edit, pieces)


def curve(n: int, phase: float) -> FloatArray:
    """(n, 3) placements: still for three frames, then on a curve; the yaw passes pi."""
    t = np.maximum(np.arange(n) - 2, 0) * 0.05
    yaw = (phase + t + np.pi) % (2 * np.pi) - np.pi
    return np.stack([np.sin(t + phase), 1 - np.cos(1.3 * t), yaw], 1)


def scene_of(captures: dict[str, tuple[MeshSequence, Path]], source: dict[str, list[int]], **axes: str) -> ExportScene:
    """An edit of small captures."""
    n = len(next(iter(source.values())))
    subjects = {w: SubjectEdit(np.array(source[w]), curve(n, i + 0.5)) for i, w in enumerate(source)}
    units, up = axes.get("units", "m"), axes.get("up", "z")
    pieces = tuple(Piece(w, BODY, w, captures[w][0], captures[w][1], units, up) for w in source)
    return ExportScene(EditedScene("small", 24.0, n, subjects, (), 0.0, 0.0, 0.0), pieces)


def frame_mesh(scene: ExportScene, piece: Piece, frame: int) -> Mesh:
    """What has to be seen of a piece in a frame, in the capture's frame."""
    return piece.sequence.mesh(int(scene.source(piece)[frame]))


def world(scene: ExportScene, piece: Piece, frame: int) -> FloatArray:
    """(V, 3) where it has to be, from the float32 vertices that all files hold."""
    points = frame_mesh(scene, piece, frame).vertices.astype(np.float32).astype(np.float64)
    if piece.subject in scene.edit.props:
        prop = scene.edit.props[piece.subject]
        return np.asarray(Rotation.from_quat(prop.rotations[frame]).apply(points) + prop.positions[frame])
    return apply_pose(scene.edit.subjects[piece.subject].placements[frame], points)


def write_edit(out: Path, edit: EditedScene, scene_file: Path) -> Path:
    """An output folder, as far as an export needs it."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "edit.json").write_text(json.dumps(edit_as_dict(edit)))
    (out / "scene.json").write_text(json.dumps({"scene": str(scene_file)}))
    return out
