"""What each frame of a capture costs before the search: one line a stage, beside an honest baseline and a bound.

Reading and voxelising are measured on one core, the best of several runs, on a frame of the bundled duel (written as
OBJ) and on a larger capture of the shared data where that is there. The bound is the bytes that have to be moved at
the speed of a plain copy, or the operations that have to be done at the speed of a plain sum of products, both
measured in the same run. Plan, track and gaze are measured over many frames, by wall clock and by processor.
"""

import argparse
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import open3d as o3d
import pyvista as pv
import trimesh

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.closed import has_no_boundary
from mhvedit.pipeline.people import place_in_plan
from mhvedit.sequences.bodies import FINE, TRACKING, BodyTrack, track_body
from mhvedit.sequences.body_fit import BodyPose, fit_body
from mhvedit.sequences.body_model import N_JOINTS, plain_adult
from mhvedit.sequences.cache import cached_mesh
from mhvedit.sequences.canonical import capture_from_canonical
from mhvedit.sequences.gaze import gaze_of_body
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.obj import parse_obj
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.surface_cloud import own_frame, surface_cloud
from mhvedit.volumes.subject import subject_volumes
from mhvedit.volumes.voxelise import solid_voxels

PROJECT = Path(__file__).resolve().parents[1]
DUEL = PROJECT / "data" / "duel" / "anna"
LARGE = PROJECT.parent / "shared" / "data" / "captures" / "dancer"
PITCH = 0.01  # m
PER_CONE, PER_WISH = 30, 8  # operations for a point and a cone, for a point and a place on an axis


def best(function: Callable[[], object], *, runs: int = 15) -> float:
    """Milliseconds of the fastest run, after one that does not count."""
    function()
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return 1e3 * min(times)


def bytes_a_ms() -> float:
    """What a plain copy moves, both ways counted."""
    block = np.ones(1 << 25, np.uint8)
    return 2 * len(block) / best(block.copy)


def operations_a_ms() -> float:
    """Multiplications and additions of a plain sum of products in cache."""
    a, b = np.ones(4096), np.ones(4096)
    return 2 * 1000 * len(a) / best(lambda: [np.multiply(a, b, out=b) for _ in range(1000)])


def line(stage: str, ours: float, bound: float, baselines: dict[str, float]) -> None:
    """Print a stage."""
    beside = "   ".join(f"{name} {ms:.1f} ms ({ms / ours:.1f} x)" for name, ms in baselines.items())
    print(f"{stage:34s} {ours:7.2f} ms   bound {bound:6.3f} ms ({ours / bound:5.1f} x)   {beside}")


def write_obj(path: Path, mesh: Mesh) -> None:
    """Positions to a micrometre, and faces."""
    rows = [f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in mesh.vertices.tolist()]
    path.write_text("".join(rows + [f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist()]))


def reading(mesh: Mesh, folder: Path, speed: float) -> None:
    """An OBJ, and the cached form of it."""
    file, n = folder / "frame_0001.obj", len(mesh.faces)
    write_obj(file, mesh)
    size = file.stat().st_size
    ours = best(lambda: parse_obj(file.read_bytes(), file))
    others = {
        "pyvista": best(lambda: pv.read(file), runs=5),
        "trimesh": best(lambda: trimesh.load(file, process=False, maintain_order=True), runs=3),
        "float(word)": best(lambda: by_words(file), runs=3),
    }
    assert parse_obj(file.read_bytes(), file).vertices.tolist() == by_words(file)
    line(f"OBJ, {n} faces, {size / 1e6:.2f} MB", ours, size / speed, others)
    raw = RawMesh(mesh.vertices, mesh.faces)
    key = f"kept_{n}"
    kept = folder / f"{key}.npz"
    cached_mesh(folder, key, lambda: raw)
    content = kept.read_bytes()
    ours = best(lambda: cached_mesh(folder, key, lambda: raw))
    plain = {"bytes and their sum alone": best(lambda: zlib.crc32(kept.read_bytes()))}
    line(f"cached frame, {len(content) / 1e6:.2f} MB", ours, 2 * len(content) / speed, plain)

    def fresh() -> None:
        kept.unlink()
        cached_mesh(folder, key, lambda: raw)

    line("cached frame, written", best(fresh), 2 * len(content) / speed, {})


def by_words(file: Path) -> list[list[float]]:
    """The vertices, by the plainest code."""
    return [[float(word) for word in row.split()[1:4]] for row in file.read_text().split("\n") if row[:2] == "v "]


def voxelising(mesh: Mesh, speed: float) -> None:
    """Solid voxels of a frame as it is, and of one that lacks a few faces."""
    torn = Mesh(mesh.vertices, mesh.faces[5:])
    shown = [mesh, torn] if has_no_boundary(mesh.faces) else [mesh]
    for solid in shown:
        voxelising_one(solid, speed)


def voxelising_one(mesh: Mesh, speed: float) -> None:
    """Solid voxels of a mesh, closed or not."""
    closed = has_no_boundary(mesh.faces)
    grid, filled = solid_voxels(mesh, PITCH)
    touched = mesh.vertices.nbytes + mesh.faces.nbytes * (2 if closed else 4) + 3 * filled.size
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    tensor = o3d.core.Tensor.from_numpy
    scene.add_triangles(tensor(mesh.vertices.astype(np.float32)), tensor(mesh.faces.astype(np.uint32)))
    axes = np.meshgrid(*(grid.axis(k) for k in range(3)), indexing="ij")
    centres = tensor(np.stack(axes, -1).astype(np.float32))
    surface = pv.PolyData(mesh.vertices, np.hstack([np.full((len(mesh.faces), 1), 3), mesh.faces]))
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    others = {
        "open3d": best(lambda: scene.compute_occupancy(centres, nthreads=1), runs=2),
        "pyvista": best(lambda: surface.voxelize_binary_mask(spacing=(PITCH,) * 3), runs=3),
        "trimesh": best(lambda: whole.voxelized(PITCH).fill(), runs=2),
    }
    name = f"voxels, {len(mesh.faces)} faces, {'closed' if closed else 'six rays'}"
    line(name, best(lambda: solid_voxels(mesh, PITCH)), touched / speed, others)


def stages(folder: Path, n_frames: int, workers: int, rate: float) -> None:
    """Plan, track, gaze and voxels over many frames, from OBJ files with nothing kept and from kept frames."""
    source = open_capture(DUEL, name="anna", fps=25)
    (folder / "anna").mkdir()
    for number in source.numbers[:n_frames]:
        write_obj(folder / "anna" / f"anna_{number:04d}.obj", source.mesh(number))
    warm = MeshSequence("warm", source.numbers[:1], 25.0, source.load)
    gaze_of_body(warm, track_body(warm))
    capture = open_capture(folder / "anna", name="anna", fps=25, cache=folder / "cache")
    pose = capture_from_canonical(warm)
    found: list[BodyTrack] = []
    jobs: dict[str, Callable[[], object]] = {
        "plan, and OBJ to kept frames": lambda: place_in_plan(capture, workers=workers),
        "plan from kept frames": lambda: place_in_plan(capture, workers=workers),
        "track the body": lambda: found.append(track_body(capture, workers=workers)),
        "gaze": lambda: gaze_of_body(capture, found[0], workers=workers),
        "voxels and history": lambda: subject_volumes(
            capture, {}, numbers=capture.numbers[:25], pose=pose, pitch=PITCH, wanted=frozenset(), workers=workers
        ),
    }
    for name, job in jobs.items():
        began = time.perf_counter(), time.process_time()
        job()
        wall, spent = time.perf_counter() - began[0], time.process_time() - began[1]
        n = 25 if name.startswith("voxels") else n_frames
        print(f"{name:34s} {1e3 * wall / n:7.2f} ms a frame by the clock, {1e3 * spent / n:6.2f} ms of processor")
    mesh = source.mesh(source.numbers[0])
    cloud = surface_cloud(mesh, own_frame(mesh), cell=FINE)
    model, still = plain_adult(), BodyPose(np.tile(np.eye(3), (N_JOINTS, 1, 1)), np.zeros(3), np.zeros(2))
    line(
        "one fit while tracking",
        best(lambda: fit_body(model, cloud, still, sigma=TRACKING)),
        operations(cloud) / rate,
        {},
    )


def operations(cloud: FloatArray) -> float:
    """Of one fit: every point against every cone, every wish against every point, and the normal equations."""
    model = plain_adult()
    n_cones, depth = len(model.cone_joint), (model.chains >= 0).sum(1)[model.cone_joint].mean()
    row = 5 + 3 * depth
    once = len(cloud) * (n_cones * PER_CONE + 3 * n_cones * PER_WISH + row * row)
    return float(len(TRACKING) * (once + (5 + 3 * len(model.parents)) ** 3 / 3))


def main() -> None:
    """All stages; `--frames N` for plan, track and gaze, `--workers N`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    speed, rate = bytes_a_ms(), operations_a_ms()
    print(f"plain copy {speed / 1e6:.1f} GB/s, plain products {rate / 1e6:.1f} G operations/s\n")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        meshes = [open_capture(DUEL, name="anna", fps=25).mesh(100)]
        if LARGE.is_dir():
            large = open_capture(LARGE, name="large", fps=30)
            meshes.append(large.mesh(large.numbers[0]))
        for mesh in meshes:
            reading(mesh, folder, speed)
            voxelising(mesh, speed)
            print()
        stages(folder, asked.frames, asked.workers, rate)


if __name__ == "__main__":
    main()
