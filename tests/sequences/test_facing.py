"""Facing: equivariance under planar motion, independence of the meshing, and the error on the shared takes."""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.errors import SceneError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, wrap_angle
from mhvedit.sequences.bodies import _key_frames, horizontal_front, track_body
from mhvedit.sequences.body_fit import WRONG_SIDE, BodyPose, _add_residuals, _explain, fit_body, joint_places
from mhvedit.sequences.body_model import N_JOINTS, plain_adult, rotation_from_vector
from mhvedit.sequences.facing import facing_from_tracks, facing_of_body
from mhvedit.sequences.meshes import Facing, JointTracks, Mesh, MeshSequence
from mhvedit.sequences.surface_cloud import surface_cloud
from tests.shapes import mesh_of

SCENES = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes"
FIGURE = (  # ellipsoids of a person who looks along +x: centre, half axes
    ((0.0, 0.0, 1.05), (0.11, 0.17, 0.22)),
    ((0.0, 0.0, 1.32), (0.11, 0.19, 0.15)),
    ((0.0, 0.0, 1.50), (0.05, 0.05, 0.09)),
    ((0.015, 0.0, 1.66), (0.098, 0.076, 0.11)),
    ((0.0, 0.23, 1.24), (0.05, 0.05, 0.20)),
    ((0.0, -0.23, 1.24), (0.05, 0.05, 0.20)),
    ((0.10, 0.23, 1.06), (0.15, 0.04, 0.05)),
    ((0.10, -0.23, 1.06), (0.15, 0.04, 0.05)),
    ((0.0, 0.10, 0.68), (0.08, 0.08, 0.26)),
    ((0.0, -0.10, 0.68), (0.08, 0.08, 0.26)),
    ((-0.01, 0.10, 0.27), (0.055, 0.055, 0.24)),
    ((-0.01, -0.10, 0.27), (0.055, 0.055, 0.24)),
    ((0.05, 0.10, 0.04), (0.13, 0.045, 0.04)),
    ((0.05, -0.10, 0.04), (0.13, 0.045, 0.04)),
)


def figure(subdivisions: int = 3) -> Mesh:
    balls = []
    for centre, axes in FIGURE:
        ball = trimesh.creation.icosphere(subdivisions=subdivisions)
        ball.vertices = ball.vertices * axes + centre
        balls.append(ball)
    return mesh_of(trimesh.util.concatenate(balls))


def placed(mesh: Mesh, pose: FloatArray) -> Mesh:
    return Mesh(apply_pose(pose, mesh.vertices), mesh.faces)


def sequence(*meshes: Mesh) -> MeshSequence:
    return MeshSequence("figure", tuple(range(len(meshes))), 25.0, lambda number: meshes[number])


def facing_of(capture: MeshSequence, *, workers: int = 1) -> Facing:
    return facing_of_body(track_body(capture, workers=workers), fps=capture.fps)


def degrees_off(yaw: FloatArray, truth: FloatArray | float) -> FloatArray:
    return np.degrees(np.abs(wrap_angle(yaw - truth)))


@pytest.mark.parametrize("yaw", [0.0, 1.1, 3.0, -2.2])
def test_a_figure_faces_where_its_feet_and_forearms_point(yaw: float) -> None:
    facing = facing_of(sequence(placed(figure(2), np.array([3.0, -2.0, yaw]))))
    assert degrees_off(facing.yaw, yaw)[0] < 3
    assert 0.3 < facing.trust[0] <= 1


def test_the_estimate_turns_and_shifts_with_the_capture() -> None:
    frames = [placed(figure(2), np.array([0.03 * t, 0.01 * t, 0.4 + 0.02 * t])) for t in range(4)]
    pose = np.array([-7.0, 11.0, 2.3])
    body, moved = track_body(sequence(*frames)), track_body(sequence(*[placed(mesh, pose) for mesh in frames]))
    assert moved.places == pytest.approx(apply_pose(pose, body.places), abs=1e-6)
    facing, turned = facing_of(sequence(*frames)), facing_of(sequence(*[placed(m, pose) for m in frames]))
    assert np.abs(wrap_angle(turned.yaw - facing.yaw - pose[2])).max() < 1e-6
    assert turned.trust == pytest.approx(facing.trust, abs=1e-6)


def test_the_number_of_threads_does_not_matter() -> None:
    frames = sequence(*[placed(figure(2), np.array([0.03 * t, 0.0, 0.4 + 0.1 * t])) for t in range(3)])
    one, three = track_body(frames), track_body(frames, workers=3)
    for name in ("places", "head", "misfit", "size"):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))
    assert facing_of(frames).yaw.tobytes() == facing_of(frames, workers=2).yaw.tobytes()


def test_neither_the_order_nor_the_density_of_the_mesh_matters() -> None:
    mesh = figure(2)
    random = np.random.default_rng(5)
    order = random.permutation(len(mesh.vertices))
    place = np.argsort(order)
    faces = place[np.roll(mesh.faces, 1, axis=1)][random.permutation(len(mesh.faces))].astype(np.int32)
    yaw = facing_of(sequence(mesh)).yaw
    assert facing_of(sequence(Mesh(mesh.vertices[order], faces))).yaw == pytest.approx(yaw, abs=1e-6)
    assert degrees_off(facing_of(sequence(figure(4))).yaw, yaw)[0] < 1.5


def test_noise_holes_and_floating_bits_hardly_matter() -> None:
    mesh, random = figure(3), np.random.default_rng(7)
    noisy = mesh.vertices + random.normal(scale=0.0013, size=mesh.vertices.shape)
    kept = mesh.faces[random.random(len(mesh.faces)) > 0.03]
    bit = np.array([[0.9, 0.9, 1.0], [0.95, 0.9, 1.0], [0.9, 0.95, 1.0]])
    faces = np.concatenate([kept, np.arange(3, dtype=np.int32)[None] + np.int32(len(noisy))])
    facing = facing_of(sequence(Mesh(np.concatenate([noisy, bit]), faces)))
    assert degrees_off(facing.yaw, 0.0)[0] < 4


def test_a_figure_on_its_back_faces_its_feet() -> None:
    mesh = figure(2)
    back = rotation_from_vector(np.array([0.0, -np.pi / 2, 0.0]))  # the head now points to -x, the feet to +x
    facing = facing_of(sequence(Mesh(mesh.vertices @ back.T + [0, 0, 0.15], mesh.faces)))
    assert degrees_off(facing.yaw, 0.0)[0] < 8


def test_a_shape_that_is_nobody_gets_an_answer_with_little_trust() -> None:
    mesh = mesh_of(trimesh.creation.box(extents=(60.0, 40.0, 30.0)))
    facing = facing_of(sequence(mesh, mesh))
    assert np.isfinite(facing.yaw).all()
    assert (facing.trust < 0.05).all()


def test_a_frame_without_area_is_bridged() -> None:
    mesh = figure(2)
    nothing = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    facing = facing_of(sequence(mesh, nothing, mesh))
    assert degrees_off(facing.yaw, 0.0).max() < 3
    assert facing.trust[1] < 0.01 < facing.trust[0]


def test_the_model_finds_back_a_pose_of_its_own() -> None:
    model = plain_adult()
    still = BodyPose(np.tile(np.eye(3), (N_JOINTS, 1, 1)), np.array([0.0, 0.0, 0.95]), np.zeros(2))
    cloud = surface_cloud(figure(3), np.zeros(3), cell=0.055)
    nudged = np.tile(rotation_from_vector(np.array([0.0, 0.1, 0.3])), (N_JOINTS, 1, 1))
    sigma = np.full(25, 0.08)
    first, energy = fit_body(model, cloud, still, sigma=sigma)
    second, _ = fit_body(model, cloud, BodyPose(nudged, still.pelvis + 0.03, still.shape), sigma=sigma)
    assert energy < 1.5e-3
    assert joint_places(model, second)[:4] == pytest.approx(joint_places(model, first)[:4], abs=0.02)


def residual_of_point(point: FloatArray, cones: FloatArray) -> tuple[float, int]:
    """Squared misfit of an oriented point and the cone that explains it best, cone by cone."""
    costs = []
    for start, end, a, b in zip(cones[:3].T, cones[3:6].T, cones[6], cones[7], strict=True):
        along = np.clip((point[:3] - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
        arm = point[:3] - start - along * (end - start)
        far = np.linalg.norm(arm)
        costs.append((far - a - along * (b - a)) ** 2 + (WRONG_SIDE * (1 - point[3:6] @ arm / far)) ** 2)
    return float(min(costs)), int(np.argmin(costs))


def test_every_point_is_explained_by_the_cone_that_fits_it_best() -> None:
    rng = np.random.default_rng(3)
    cones = np.vstack([rng.normal(size=(6, 9)), rng.uniform(0.05, 0.4, (2, 9))])
    normals = rng.normal(size=(60, 3))
    cloud = np.column_stack([rng.normal(size=(60, 3)), normals / np.linalg.norm(normals, axis=1)[:, None], np.ones(60)])
    chosen, fits = np.empty(60, np.int64), np.empty((60, 3))
    _explain(cloud, cones, chosen, fits)
    expected = [residual_of_point(point, cones) for point in cloud]
    assert fits[:, 2] == pytest.approx([cost for cost, _ in expected])
    assert chosen.tolist() == [cone for _, cone in expected]


def test_the_gradient_is_the_slope_of_the_residuals() -> None:
    """By finite differences: half the sum of weighted squares, the body moved by small steps."""
    model, rng = plain_adult(), np.random.default_rng(8)
    pose = BodyPose(np.tile(np.eye(3), (N_JOINTS, 1, 1)), np.array([0.0, 0.0, 0.95]), np.zeros(2))
    places, riding = joint_places(model, pose), np.array([3, 7, 10])
    normals = rng.normal(size=(3, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    at, radius, gap, weight = (
        places[riding] + rng.normal(scale=0.1, size=(3, 3)),
        rng.random(3),
        rng.random(3),
        rng.random(3),
    )
    size = 5 + 3 * N_JOINTS
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    residuals = np.column_stack([normals, at, radius, gap, weight])
    _add_residuals(residuals, riding, model.chains, places, hessian, gradient)

    def half_squares(step: FloatArray) -> float:
        total = 0.0
        for row in range(3):
            moved, joint = at[row].copy(), int(riding[row])
            while joint >= 0:
                moved += np.cross(step[3 + 3 * joint : 6 + 3 * joint], at[row] - places[joint])
                joint = int(model.parents[joint])
            moved += step[:3] + step[-2] * (at[row] - places[0])
            left = gap[row] - normals[row] @ (moved - at[row]) - radius[row] * (step[-2] + step[-1])
            total += 0.5 * weight[row] * left**2
        return total

    steps = 1e-6 * np.eye(size)
    slopes = [(half_squares(step) - half_squares(-step)) / 2e-6 for step in steps]
    assert gradient == pytest.approx(slopes, abs=1e-8)
    bends = [(half_squares(1e3 * s) - 2 * half_squares(0 * s) + half_squares(-1e3 * s)) / 1e-6 for s in steps]
    assert np.diag(hessian) == pytest.approx(bends, abs=1e-6)


@pytest.mark.parametrize("n_frames", [1, 2, 10, 61, 425])
def test_key_frames_cover_both_ends(n_frames: int) -> None:
    keys = _key_frames(n_frames)
    assert (keys[0], keys[-1]) == (0, n_frames - 1)
    assert max(np.diff(keys), default=0) <= 90


def test_the_front_is_left_of_left_to_right() -> None:
    assert horizontal_front(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.3]])) == pytest.approx([0.0, np.pi / 2])


def tracks_of(joints: tuple[str, ...], positions: FloatArray) -> JointTracks:
    return JointTracks(np.arange(len(positions)), joints, positions)


def test_a_given_track_is_taken_as_it_is() -> None:
    positions = np.array([[[9.0, 9.0, 9.0], [0.0, 1.0, 0.2]], [[9.0, 9.0, 9.0], [-1.0, 0.0, 0.0]]])
    facing = facing_from_tracks(tracks_of(("hand", "facing"), positions))
    assert np.abs(wrap_angle(facing.yaw - [np.pi / 2, np.pi])) == pytest.approx([0, 0])
    assert facing.trust == pytest.approx([1, 1])
    assert facing_from_tracks(tracks_of(("f",), positions[:, 1:])).yaw == pytest.approx(facing.yaw)


def test_tracks_that_say_nothing_are_refused() -> None:
    with pytest.raises(SceneError, match="frame 1"):
        facing_from_tracks(tracks_of(("facing",), np.array([[[1.0, 0, 0]], [[0, 0, 1.0]]])))
    with pytest.raises(SceneError, match="frame 0"):
        facing_from_tracks(tracks_of(("facing",), np.full((1, 1, 3), np.nan)))
    with pytest.raises(SceneError, match="hand, foot"):
        facing_from_tracks(tracks_of(("hand", "foot"), np.ones((1, 2, 3))))


def true_yaw(path: Path, number: int) -> float:
    with path.open() as lines:
        rows = [row for row in csv.DictReader(lines) if int(row["frame"]) == number]
    at = {row["joint"]: np.array([float(row["x"]), float(row["y"])]) for row in rows}
    lines_across = [at["RightUpLeg"] - at["LeftUpLeg"], at["RightArm"] - at["LeftArm"]]
    across = np.sum([line / np.linalg.norm(line) for line in lines_across], axis=0)
    return float(np.arctan2(across[0], -across[1]))


@pytest.mark.skipif(not SCENES.is_dir(), reason="the shared data is not here")
@pytest.mark.parametrize("take", ["greeting/b", "pushup_grab/b", "salsa_open/a", "crawl_out/b", "box_follow/a"])
def test_real_takes_are_met(take: str) -> None:
    draco = pytest.importorskip("DracoPy")
    numbers = tuple(range(0, 60, 10))

    def load(number: int) -> Mesh:
        found = draco.decode((SCENES / take / f"{take[-1]}_{number:04d}.drc").read_bytes())
        return Mesh(np.asarray(found.points, np.float64), np.asarray(found.faces, np.int32).reshape(-1, 3))

    facing = facing_of(MeshSequence("take", numbers, 2.5, load))
    error = degrees_off(facing.yaw, np.array([true_yaw((SCENES / take).with_suffix(".csv"), n) for n in numbers]))
    assert np.median(error) < 6
    assert error.max() < 20
