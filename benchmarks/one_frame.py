"""What one frame costs on one core: voxels of a mesh of 40,000 faces, closed and torn, and the cached form of a frame.

    python -m benchmarks.one_frame

prints milliseconds as JSON.
"""

import json
import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d

from benchmarks.duel import BUNDLED
from benchmarks.frames import PITCH, best
from mhvedit.geometry.closed import has_no_boundary
from mhvedit.sequences.cache import cached_mesh
from mhvedit.sequences.meshes import Mesh
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.read import open_capture
from mhvedit.volumes.voxelise import solid_voxels

FACES = 40_000
FRAME = 100
TORN = 5  # faces that are taken out


def with_faces(mesh: Mesh, n_faces: int) -> Mesh:
    """The same surface with another number of faces: every face quartered, and then decimated."""
    solid = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces))
    made = solid.subdivide_midpoint(1).simplify_quadric_decimation(n_faces)
    return Mesh(np.asarray(made.vertices, np.float64), np.asarray(made.triangles, np.int32))


def main() -> None:
    """Print the figures."""
    mesh = with_faces(open_capture(BUNDLED / "anna", name="anna", fps=25).mesh(FRAME), FACES)
    if not has_no_boundary(mesh.faces):
        raise ValueError("the mesh is not closed")
    torn = Mesh(mesh.vertices, mesh.faces[TORN:])
    with tempfile.TemporaryDirectory() as folder:
        raw = RawMesh(mesh.vertices, mesh.faces)
        cached_mesh(Path(folder), "frame", lambda: raw)
        read = best(lambda: cached_mesh(Path(folder), "frame", lambda: raw))
    figures = {
        "faces": len(mesh.faces),
        "closed": best(lambda: solid_voxels(mesh, PITCH)),
        "torn": best(lambda: solid_voxels(torn, PITCH)),
        "cached": read,
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
