"""Meshes as convex pieces: checked, cut by approximate convex decomposition (coacd), and kept on disk."""

import hashlib
import logging
from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from mhvedit.errors import MissingLibrary
from mhvedit.files import UNREADABLE, load_npz, replacing
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.world.pieces import Piece, hull, mesh_mass
from mhvedit.world.problems import WorldError

CONVEX: Final = 0.999  # a mesh that fills this much of its hull is one piece
CONCAVITY: Final = 0.03  # coacd's threshold, of the size of the mesh
SMALLEST: Final = 1e-9  # m3
_VERSION: Final = b"1 coacd"  # of what is kept
_log = logging.getLogger(__name__)


def check_solid(name: str, vertices: FloatArray, faces: Int32Array) -> None:
    """Say so where a mesh encloses no volume.

    Raises:
        WorldError: coordinates that are not numbers, open edges, faces that look inwards, no volume.
    """
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or not np.isfinite(vertices).all():
        raise WorldError(name, "(V, 3) finite vertices", f"{vertices.shape} with NaN or infinity")
    if faces.ndim != 2 or faces.shape[1:] != (3,) or not len(faces):
        raise WorldError(name, "(F, 3) triangles, at least 4", f"{faces.shape}")
    mesh = _mesh(vertices, faces)
    if not mesh.is_watertight:
        edges = trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1)
        raise WorldError(name, "a closed mesh", f"{len(edges)} open edges")
    volume = mesh_mass(vertices, faces).volume
    if volume < SMALLEST:
        raise WorldError(name, "a mesh that encloses a volume, faces looking outwards", f"{volume:.3g} m3")


def convex_pieces(
    name: str, vertices: FloatArray, faces: Int32Array, *, cache: Path | None = None
) -> tuple[Piece, ...]:
    """A closed mesh as convex pieces; a mesh that is convex already stays as it is.

    Args:
        name: for messages.
        vertices: (V, 3) m.
        faces: (F, 3).
        cache: folder in which decompositions are kept by content.

    Raises:
        WorldError: the mesh encloses no volume.
        MissingLibrary: coacd is not installed.
    """
    check_solid(name, vertices, faces)
    whole = hull(vertices)
    if mesh_mass(vertices, faces).volume >= CONVEX * mesh_mass(whole.points, whole.faces).volume:
        return (whole,)
    if cache is None:
        return tuple(hull(points) for points in _decomposed(vertices, faces))
    content = np.ascontiguousarray(vertices, np.float64).tobytes() + np.ascontiguousarray(faces, np.int32).tobytes()
    file = cache / f"convex-{hashlib.sha256(_VERSION + content).hexdigest()[:32]}.npz"
    return tuple(hull(points) for points in _kept(file, vertices, faces))


def _kept(file: Path, vertices: FloatArray, faces: Int32Array) -> list[FloatArray]:
    """Points of the pieces from a file, which is written where there is none or it is damaged."""
    try:
        stored = load_npz(file, "points", "starts")
        return [np.asarray(part) for part in np.split(stored["points"], stored["starts"][1:])]
    except FileNotFoundError:
        pass
    except UNREADABLE as error:
        _log.warning("%s: damaged cache file is rebuilt (%s)", file, error)
    parts = _decomposed(vertices, faces)
    starts = np.cumsum([0] + [len(part) for part in parts[:-1]])
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as beside, beside.open("wb") as out:
            np.savez(out, points=np.concatenate(parts), starts=starts)
    except OSError as error:
        _log.warning("%s: cache file cannot be written, going on without it (%s)", file, error)
    return parts


def _decomposed(vertices: FloatArray, faces: Int32Array) -> list[FloatArray]:
    """Points of the pieces, always the same for the same mesh."""
    try:
        import coacd
    except ImportError as error:
        raise MissingLibrary("convex pieces of a mesh", "pip install coacd") from error
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=CONCAVITY, seed=0)
    return [np.asarray(points, np.float64) for points, _ in parts]


def _mesh(vertices: FloatArray, faces: Int32Array) -> trimesh.Trimesh:
    """As it is, nothing merged or dropped."""
    return trimesh.Trimesh(vertices, faces, process=False, maintain_order=True)
