"""Opens the props of a scene file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mhvedit.errors import CaptureError, SceneError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.project.schema import PropSpec, SceneFile
from mhvedit.sequences.axes import to_metres_z_up
from mhvedit.sequences.formats import PARSERS, parse_mesh
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import ASSUMED_FPS, open_capture
from mhvedit.skeleton.bvh import JointMotion, read_joint_motion


@dataclass(frozen=True, slots=True, eq=False)
class Prop:
    """A prop whose files are open; metres and z up, in its own frame."""

    spec: PropSpec
    sequence: MeshSequence  # of one frame, or of those of its capture
    motion: JointMotion | None = None  # of its own frame, where that was recorded

    @property
    def name(self) -> str:
        """As in the scene file."""
        return self.spec.name

    @property
    def place(self) -> FloatArray:
        """(3,) x, y m and yaw rad on the stage."""
        spot = self.spec.place
        return np.array([spot.x, spot.y, spot.yaw])

    @property
    def mesh(self) -> Mesh:
        """What it looks like at first; a fixed prop always does."""
        return self.sequence.mesh(self.sequence.numbers[0])


def open_props(scene: SceneFile, *, cache: Path | None) -> Mapping[str, Prop]:
    """Open all props of a scene.

    Args:
        scene: from `load_scene`.
        cache: folder for converted meshes, or None for none.

    Raises:
        CaptureError: a file cannot be used.
        SceneError: something is driven, but by nothing.
    """
    return {name: _prop(spec, scene.file, cache) for name, spec in scene.props.items()}


def _prop(spec: PropSpec, file: Path, cache: Path | None) -> Prop:
    """One prop. What is driven has to know where to: by its motion, or by its frames."""
    sequence = _opened(spec, cache)
    if spec.motion is not None:
        asked = spec.motion
        motion = read_joint_motion(asked.path.path, joint=asked.joint, units=asked.units, up=asked.up)
        return Prop(spec, sequence, motion)
    if spec.kind == "driven" and len(sequence.numbers) == 1:
        raise SceneError(file, spec.key, 'a motion, or captured frames, of what is "driven"', "a single mesh")
    return Prop(spec, sequence)


def _opened(spec: PropSpec, cache: Path | None) -> MeshSequence:
    """A single mesh file, or a capture."""
    path = spec.path.path
    if path.is_dir() or path.suffix.lower() not in PARSERS:
        return open_capture(path, name=spec.name, units=spec.units, up=spec.up, cache=cache)
    try:
        raw = parse_mesh(path.read_bytes(), path)
    except OSError as error:
        raise CaptureError(path, "a file that can be read", str(error.strerror)) from error
    mesh = Mesh(to_metres_z_up(raw.vertices, units=spec.units, up=spec.up), raw.faces, raw.labels)
    return MeshSequence(spec.name, (0,), ASSUMED_FPS, lambda number: mesh, (path,))
