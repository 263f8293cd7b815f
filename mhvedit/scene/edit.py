"""The edited scene, complete without the meshes: who shows which captured frame when, and where they stand."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.scene.touched import Touched, read_touched
from mhvedit.sequences.meshes import Mesh, MeshSequence

FORMAT = 1
TOUCHED = "touched"  # folder, beside `edit.json`, of the meshes that props have stopped


@dataclass(frozen=True, slots=True, eq=False)
class SubjectEdit:
    """One subject through the whole scene; which mesh it shows in a frame is for `scene.shown` to say."""

    source: IntArray  # (N,) frame numbers of the capture
    placements: FloatArray  # (N, 3) x, y m and yaw rad: world_from_capture
    touched: Touched | None = None  # frames with meshes of their own, which props have stopped


@dataclass(frozen=True, slots=True, eq=False)
class SegmentEdit:
    """One key segment in the scene, and the solution chosen for it."""

    name: str
    start: int  # first frame in the scene
    stop: int  # past the last
    interaction: str
    between: tuple[str, str]
    distance: float  # L, m
    theta_a: float  # rad
    theta_b: float  # rad
    relative: FloatArray  # (3,) x, y m and yaw rad of B's capture frame in A's


@dataclass(frozen=True, slots=True, eq=False)
class PropEdit:
    """One prop through the whole scene."""

    source: str  # path of its mesh, as in the scene file
    kind: str  # fixed, simulated or driven
    frames: IntArray  # (N,) frame numbers of its capture; one and the same for a single mesh
    positions: FloatArray  # (N, 3) m
    rotations: FloatArray  # (N, 4) x, y, z, w: p_world = R p + position, with the mesh in metres and z up


@dataclass(frozen=True, slots=True, eq=False)
class EditedScene:
    """What a solve decides."""

    name: str
    fps: float  # Hz
    n_frames: int
    subjects: Mapping[str, SubjectEdit]
    segments: tuple[SegmentEdit, ...]
    cost: float  # m^2
    lower_bound: float  # m^2
    gap: float  # percent
    props: Mapping[str, PropEdit] = field(default_factory=dict)


def placed_mesh(scene: EditedScene, captures: Mapping[str, MeshSequence], subject: str, frame: int) -> Mesh:
    """A subject's mesh in one frame of the scene, in the world.

    Args:
        scene: the edit.
        captures: by subject name.
        subject: name.
        frame: of the scene, from 0.
    """
    edit = scene.subjects[subject]
    if edit.touched is not None and frame in edit.touched.frames:
        mesh = edit.touched.meshes.mesh(frame)
    else:
        mesh = captures[subject].mesh(int(edit.source[frame]))
    return Mesh(apply_pose(edit.placements[frame], mesh.vertices), mesh.faces, mesh.labels)


def placed_prop(scene: EditedScene, captures: Mapping[str, MeshSequence], name: str, frame: int) -> Mesh:
    """A prop's mesh in one frame of the scene, in the world.

    Args:
        scene: the edit.
        captures: by prop name.
        name: of the prop.
        frame: of the scene, from 0.
    """
    edit = scene.props[name]
    mesh = captures[name].mesh(int(edit.frames[frame]))
    turn = rotation_matrices(edit.rotations[frame])
    return Mesh(mesh.vertices @ turn.T + edit.positions[frame], mesh.faces, mesh.labels)


def edit_as_dict(scene: EditedScene) -> dict[str, Any]:
    """The content of `edit.json`."""
    return {
        "version": FORMAT,
        "name": scene.name,
        "fps": scene.fps,
        "frames": scene.n_frames,
        "subjects": {
            name: {
                "source": edit.source.tolist(),
                "x": edit.placements[:, 0].tolist(),
                "y": edit.placements[:, 1].tolist(),
                "yaw": edit.placements[:, 2].tolist(),
            }
            | ({} if edit.touched is None else {"touched": _touched_as_dict(name, edit.touched)})
            for name, edit in scene.subjects.items()
        },
        "segments": [
            {
                "name": s.name,
                "start": s.start,
                "stop": s.stop,
                "interaction": s.interaction,
                "between": list(s.between),
                "solution": {"distance": s.distance, "theta_a": s.theta_a, "theta_b": s.theta_b},
                "relative": {"x": float(s.relative[0]), "y": float(s.relative[1]), "yaw": float(s.relative[2])},
            }
            for s in scene.segments
        ],
        "cost": scene.cost,
        "lower_bound": scene.lower_bound,
        "gap": scene.gap,
    } | ({"props": {name: _prop_as_dict(prop) for name, prop in scene.props.items()}} if scene.props else {})


def touched_path(subject: str) -> str:
    """Where a subject's stopped meshes are, beside `edit.json`."""
    return f"{TOUCHED}/{subject}.npz"


def _touched_as_dict(subject: str, touched: Touched) -> dict[str, Any]:
    return {"meshes": touched_path(subject), "frames": list(touched.frames)}


def _prop_as_dict(prop: PropEdit) -> dict[str, Any]:
    return {
        "source": prop.source,
        "class": prop.kind,
        "frames": prop.frames.tolist(),
        "position": prop.positions.tolist(),
        "rotation": prop.rotations.tolist(),
    }


def read_edit(path: Path | str) -> EditedScene:
    """Read `edit.json`.

    Raises:
        CaptureError: the file is missing or is not an edit.
    """
    try:
        data = json.loads(Path(path).read_text())
        if data["version"] != FORMAT:
            raise CaptureError(path, f"version {FORMAT}", f"version {data['version']}")
        return _edit_from(data, Path(path).parent)
    except FileNotFoundError:
        raise CaptureError(path, "an edit written by `mhvedit solve`", "no such file") from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as fault:
        if isinstance(fault, CaptureError):
            raise
        found = f"none that says {fault}" if isinstance(fault, KeyError) else str(fault)
        raise CaptureError(path, "an edit written by `mhvedit solve`", found) from fault


def _edit_from(data: dict[str, Any], folder: Path) -> EditedScene:
    subjects = {
        name: SubjectEdit(
            np.array(s["source"], np.int64),
            np.stack([np.array(s[k], np.float64) for k in ("x", "y", "yaw")], 1),
            read_touched(folder / s["touched"]["meshes"], s["touched"]["frames"]) if "touched" in s else None,
        )
        for name, s in data["subjects"].items()
    }
    segments = tuple(
        SegmentEdit(
            name=s["name"],
            start=s["start"],
            stop=s["stop"],
            interaction=s["interaction"],
            between=(s["between"][0], s["between"][1]),
            distance=s["solution"]["distance"],
            theta_a=s["solution"]["theta_a"],
            theta_b=s["solution"]["theta_b"],
            relative=np.array([s["relative"][k] for k in ("x", "y", "yaw")]),
        )
        for s in data["segments"]
    )
    props = {
        name: PropEdit(
            p["source"],
            p["class"],
            np.array(p["frames"], np.int64),
            np.array(p["position"], np.float64),
            np.array(p["rotation"], np.float64),
        )
        for name, p in data.get("props", {}).items()
    }
    return EditedScene(
        name=data["name"],
        fps=data["fps"],
        n_frames=data["frames"],
        subjects=subjects,
        segments=segments,
        cost=data["cost"],
        lower_bound=data["lower_bound"],
        gap=data["gap"],
        props=props,
    )
