"""Detection of self-collision in one run beside pinocchio with coal and python-fcl: one frame, and whole motions.

    python -m benchmarks.collision [MOTIONS] [--sampled] [--write]

MOTIONS is a folder of skinned `.npz` files. All libraries get the same work, one thread: from the joint angles of a
frame to a yes or no for each of the 231 pairs of limbs that are not adjacent, limbs rigid (A3.6), on the mesh as it is
and on one cut finer, to about the 26,700 triangles of the yardstick. Then what this package does on top: skinned
limbs, and depths. With --sampled the safe mode of reachability is held against random postures.
"""

import contextlib
import io
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import coal
import fcl
import numpy as np
import pinocchio as pin

from mhvedit.collision.detect import CollisionBody, collision_body, measure_depths, surfaces_cross
from mhvedit.collision.pairs import all_pairs
from mhvedit.collision.reachable import meeting_rates, random_postures, safely_reachable_pairs
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.skin import SkinnedBody, SkinnedMotion, read_skinned

FRAMES = 150
PAGE = Path(__file__).resolve().parents[1] / "docs" / "collision_results.md"
HEAD = """# Detection of self-collision, measured

Made by `python -m benchmarks.collision --sampled --write`: all libraries in one run, in turn for each posture, one
thread, the same 231 pairs of rigid limbs that are not adjacent; *answers differ* counts pairs of postures, away from
borders that limbs share, in which a library says otherwise than mhvedit. Depths are of skinned limbs. Times are those
of one machine. What follows on detection is measured in
[avoidance](avoidance_results.md#one-frame-beside-other-libraries).

"""
Detector = Callable[[FloatArray], BoolArray]  # (D,) to (P,)


def main() -> None:
    """Print the tables; with --write, to docs/collision_results.md too."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        print_tables()
    print(text.getvalue())
    if "--write" in sys.argv:
        PAGE.write_text(f"{HEAD}```text\n{text.getvalue().strip()}\n```\n", encoding="utf-8")


def print_tables() -> None:
    """Detection beside the libraries, whole motions, and reachability if it is asked for."""
    folder = Path(next((a for a in sys.argv[1:] if not a.startswith("-")), _default_folder()))
    motions = {path.stem: read_skinned(path) for path in sorted(folder.glob("*.npz"))}
    first = motions["walk_throw_normal"]
    postures = np.concatenate([m.motion.q[:: max(1, 6 * m.motion.n_frames // FRAMES)] for m in motions.values()])
    for name, body in (("as it is", first.body), ("cut finer", subdivided(first.body))):
        compare(f"{len(body.faces)} triangles, {name}", collision_body(body), postures[:FRAMES])
    print(f"\n{'whole motion':28} {'frames':>7} {'frames/s, crossing':>20} {'frames/s, depth':>17}")
    for name, motion in motions.items():
        print(f"{name:28} {motion.motion.n_frames:7} {throughput(motion)}")
    if "--sampled" in sys.argv:
        reachability(first, 100_000)


def compare(title: str, body: CollisionBody, postures: FloatArray) -> None:
    """Median ms a frame of each library, and where their answers differ from ours."""
    ours = surfaces_cross(body, postures, rigid=True)
    print(f"\n{title}, {len(body.pairs.limbs)} pairs, {len(postures)} postures, one thread")
    detectors: dict[str, Detector] = {
        "mhvedit": lambda q: surfaces_cross(body, q[None], rigid=True)[0],
        "pinocchio + coal": pinocchio_detector(body),
        "python-fcl": fcl_detector(body),
    }
    rows = {name: [] for name in detectors}  # type: dict[str, list[float]]
    answers = {name: [] for name in detectors}  # type: dict[str, list[BoolArray]]
    for posture in postures:
        for name, detect in detectors.items():
            start = time.perf_counter()
            answer = detect(posture)
            rows[name].append((time.perf_counter() - start) * 1e3)
            answers[name].append(answer)
    border = body.limbs.bordering[body.pairs.limbs[:, 0], body.pairs.limbs[:, 1]]
    for name, times in rows.items():
        differ = (np.array(answers[name]) != ours)[:, ~border].sum()
        median, worst = np.median(times), np.percentile(times, 95)
        print(f"  {name:22} median {median:7.3f}  p95 {worst:7.3f} ms   {differ} answers differ")
    for name, run in (
        ("mhvedit, skinned", lambda: surfaces_cross(body, postures)),
        ("mhvedit, depths", lambda: measure_depths(body, postures, workers=1)),
    ):
        start = time.perf_counter()
        run()
        print(f"  {name:22} mean   {(time.perf_counter() - start) / len(postures) * 1e3:7.3f} ms")


def throughput(motion: SkinnedMotion) -> str:
    """Frames per second for a whole motion."""
    body, q = collision_body(motion.body), motion.motion.q
    start = time.perf_counter()
    surfaces_cross(body, q)
    middle = time.perf_counter()
    measure_depths(body, q)
    end = time.perf_counter()
    return f"{len(q) / (middle - start):20.0f} {len(q) / (end - middle):17.0f}"


def reachability(motion: SkinnedMotion, count: int) -> None:
    """Both modes of A4.5: how many pairs they keep, and what the safe one loses in random postures."""
    body = collision_body(motion.body)
    every = replace(body, pairs=all_pairs(body.limbs))
    kept = {tuple(pair) for pair in safely_reachable_pairs(every).limbs.tolist()}
    rates = meeting_rates(every, random_postures(motion.body.skeleton, count, np.random.default_rng(0)))
    lost = [p for p, pair in enumerate(every.pairs.limbs.tolist()) if rates[p] > 0 and tuple(pair) not in kept]
    often = (rates >= 1e-3).sum()
    print(f"\n{len(rates)} pairs, {len(kept)} after safe pruning (the paper keeps 127 of 253)")
    print(f"{count} postures: {(rates > 0).sum()} meet, {often} in 1 of 1000; lost by pruning: {len(lost)}")


def subdivided(body: SkinnedBody) -> SkinnedBody:
    """The same body with every triangle cut into four."""
    edges = np.sort(body.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    a, b, c = body.faces.T
    ab, bc, ca = len(body.vertices) + index.reshape(-1, 3).T
    faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    vertices = np.concatenate([body.vertices, body.vertices[unique].mean(1)])
    weights = np.concatenate([body.weights, body.weights[unique].mean(1)])
    return SkinnedBody(body.skeleton, vertices, faces.astype(np.int32), weights)


def limb_meshes(body: CollisionBody) -> list[tuple[int, FloatArray, IntArray]]:
    """Joint, vertices in its frame and triangles of each limb."""
    arrays, rest = body.limbs.arrays, body.body.skeleton.rest_positions
    meshes = []
    for limb, joint in enumerate(arrays.joints):
        own = np.arange(arrays.vertex_start[limb], arrays.vertex_start[limb + 1])
        own = own[arrays.vertex[own] >= 0]
        faces = arrays.faces[arrays.face_start[limb] : arrays.face_start[limb + 1]] - arrays.vertex_start[limb]
        meshes.append((int(joint), body.body.vertices[arrays.vertex[own]] - rest[joint], faces))
    return meshes


def pinocchio_detector(body: CollisionBody) -> Detector:
    """Forward kinematics and all pairs in one call of C++."""
    skeleton, model, geometry = body.body.skeleton, pin.Model(), pin.GeometryModel()
    frames = list[int]()
    for joint in range(skeleton.n_joints):
        last = frames[skeleton.parents[joint]] if joint else 0
        place = pin.SE3(np.eye(3), skeleton.offsets[joint])
        for dof in np.flatnonzero(skeleton.dof_joint == joint):
            axis = skeleton.dof_axis[dof]
            moves = pin.JointModelPrismaticUnaligned if skeleton.dof_slides[dof] else pin.JointModelRevoluteUnaligned
            last = model.addJoint(last, moves(axis), place, skeleton.dof_names[dof])
            place = pin.SE3.Identity()
        frames.append(last)
    for name, (joint, vertices, faces) in zip(body.limbs.names, limb_meshes(body), strict=True):
        geometry.addGeometryObject(
            pin.GeometryObject(name, frames[joint], pin.SE3.Identity(), _coal_mesh(vertices, faces))
        )
    for a, b in body.pairs.limbs:
        geometry.addCollisionPair(pin.CollisionPair(int(a), int(b)))
    data, placed = model.createData(), geometry.createData()

    def detect(q: FloatArray) -> BoolArray:
        pin.computeCollisions(model, data, geometry, placed, q, False)
        return np.array([result.isCollision() for result in placed.collisionResults])

    return detect


def fcl_detector(body: CollisionBody) -> Detector:
    """Our forward kinematics, then python-fcl pair by pair."""
    request, objects = fcl.CollisionRequest(), []
    for _, vertices, faces in limb_meshes(body):
        mesh = fcl.BVHModel()
        mesh.beginModel(len(vertices), len(faces))
        mesh.addSubModel(vertices, faces)
        mesh.endModel()
        objects.append(fcl.CollisionObject(mesh))
    joints, pairs = body.limbs.arrays.joints, body.pairs.limbs.tolist()

    def detect(q: FloatArray) -> BoolArray:
        rotations, positions = joint_frames(body.body.skeleton, q)
        for joint, each in zip(joints, objects, strict=True):
            each.setTransform(fcl.Transform(rotations[joint], positions[joint]))
        return np.array([fcl.collide(objects[a], objects[b], request, fcl.CollisionResult()) > 0 for a, b in pairs])

    return detect


def _coal_mesh(vertices: FloatArray, faces: IntArray) -> coal.BVHModelOBBRSS:
    """A mesh as coal takes it."""
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in vertices:
        points.append(vertex)
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addSubModel(points, triangles)
    mesh.endModel()
    return mesh


def _default_folder() -> str:
    """Beside the repository."""
    return str(Path(__file__).resolve().parents[2] / "shared" / "data" / "motions")


if __name__ == "__main__":
    main()
