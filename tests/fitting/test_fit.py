"""Fits of a figure whose bones are known and of captures whose joint tracks are, and refusals of what is no person."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from mhvedit.errors import MhveditError
from mhvedit.fitting.body import body_in_motion
from mhvedit.fitting.capture import CaptureFit, fit_capture
from mhvedit.fitting.fit import N_JOINTS, N_POSE, Pose, joint_places
from mhvedit.fitting.joints import MIRROR, NAMES, PARENTS, joint
from mhvedit.fitting.kernels import add_surface, chain_into, pose_into
from mhvedit.fitting.quality import FitRefused, FrameFit, jumps, refusals
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.body_model import LEFT_ELBOW, RIGHT_ELBOW, RIGHT_KNEE
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.skin import posed_vertices
from tests.fitting.figures import walking
from tests.shapes import boxes

SCENES = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes"
ALLOWED = 0.025  # m, mean error of the joints
TRACKED = {
    "pelvis": "Hips", "neck": "Neck", "left_upper_arm": "LeftArm", "left_forearm": "LeftForeArm",
    "left_hand": "LeftHand", "left_thigh": "LeftUpLeg", "left_shin": "LeftLeg", "left_foot": "LeftFoot",
    "right_upper_arm": "RightArm", "right_forearm": "RightForeArm", "right_hand": "RightHand",
    "right_thigh": "RightUpLeg", "right_shin": "RightLeg", "right_foot": "RightFoot",
}  # fmt: skip


def cut(sequence: MeshSequence, frames: slice) -> MeshSequence:
    return MeshSequence(sequence.name, sequence.numbers[frames], sequence.fps, sequence.load)


def why_not(fit: CaptureFit) -> str:
    return "; ".join(refusals(fit.likeness, fit.numbers.tolist(), fit.frames))


@pytest.fixture(scope="module")
def figure_fit() -> tuple[CaptureFit, FloatArray]:
    sequence, places = walking(8)
    return fit_capture(sequence, workers=2), places


def test_the_table_of_joints_is_a_mirrored_tree() -> None:
    assert (PARENTS[1:] < np.arange(1, N_JOINTS)).all()
    assert_allclose(MIRROR[MIRROR], np.arange(N_JOINTS))
    assert (MIRROR[PARENTS[1:]] == PARENTS[MIRROR[1:]]).all()


def test_derivatives_are_finite_differences() -> None:
    rng = np.random.default_rng(3)
    rest, rotations = rng.normal(size=(N_JOINTS, 3)), np.linalg.qr(rng.normal(size=(N_JOINTS, 3, 3)))[0]
    point, normal = rng.normal(size=(1, 3)), rng.normal(size=3)
    bones, shares = np.array([[joint("left_hand"), joint("chest")]]), np.array([[0.7, 0.3]])

    def gap(step: FloatArray) -> float:
        turns = step[3:N_POSE].reshape(-1, 3).copy()
        for j in range(1, N_JOINTS):
            turns[j] += turns[PARENTS[j]]
        turned = Rotation.from_rotvec(turns).as_matrix() @ rotations
        moved = rest + step[N_POSE:].reshape(-1, 3)
        places, out, normals = np.empty_like(rest), np.empty((1, 3)), np.empty((1, 3))
        chain_into(PARENTS, moved, turned, step[:3], places)
        pose_into(point, point, bones, shares, moved, turned, places, out, normals)
        return float(normal @ out[0])

    places = joint_places(rest, Pose(rotations, np.zeros(3)))
    size = N_POSE + 3 * N_JOINTS
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    add_surface(
        point, bones, shares, PARENTS, rest, rotations, places, np.r_[normal, 1.0, 1.0][None], hessian, gradient
    )
    moves = 1e-6 * np.eye(size)
    numeric = np.array([(gap(move) - gap(-move)) / 2e-6 for move in moves])
    movable = np.r_[:N_POSE, N_POSE + 3 : size]  # the pelvis' place in the bind frame is no unknown
    assert_allclose(gradient[movable], numeric[movable], atol=1e-7)
    assert_allclose(np.tril(hessian), np.tril(np.outer(gradient, gradient)), atol=1e-10)


def test_a_figure_is_fitted_where_its_bones_are(figure_fit: tuple[CaptureFit, FloatArray]) -> None:
    fit, places = figure_fit
    assert why_not(fit) == ""
    own = [joint(name) for name in ("left_forearm", "right_forearm", "right_shin")]
    error = np.linalg.norm(fit.places[:, own] - places[:, [LEFT_ELBOW, RIGHT_ELBOW, RIGHT_KNEE]], axis=-1)
    assert error.mean() < ALLOWED + 0.015  # its knees lie elsewhere than people's, by the table's centres


def test_the_body_is_the_bound_frame_again(figure_fit: tuple[CaptureFit, FloatArray]) -> None:
    fit, _ = figure_fit
    moving = body_in_motion(fit, fps=25.0)
    bound = int(np.flatnonzero(fit.numbers == fit.template.number)[0])
    assert_allclose(joint_frames(moving.body.skeleton, moving.motion.q)[1], fit.places, atol=1e-9)
    still = np.abs(fit.rotations[bound] - np.eye(3)).max() < 1e-6
    tolerance = 1e-9 if still else 0.01
    assert_allclose(posed_vertices(moving.body, moving.motion.q[bound]), fit.template.vertices, atol=tolerance)


@pytest.mark.parametrize(
    ("scene", "who", "frames"), [("greeting", "a", slice(0, 60, 3)), ("salsa_open", "b", slice(0, 60, 3))]
)
def test_a_capture_is_fitted_near_its_joint_tracks(scene: str, who: str, frames: slice) -> None:
    whole = open_capture(SCENES / scene / who, name=who, fps=25)
    fit = fit_capture(cut(whole, frames), workers=2)
    tracks = read_tracks(SCENES / scene / f"{who}.csv")
    rows = np.searchsorted(tracks.numbers, fit.numbers)
    truth = tracks.positions[rows][:, [tracks.joints.index(name) for name in TRACKED.values()]]
    error = np.linalg.norm(fit.places[:, [joint(name) for name in TRACKED]] - truth, axis=-1)
    assert error.mean() < ALLOWED
    assert why_not(fit) == ""


def standing(*meshes: Mesh) -> MeshSequence:
    return MeshSequence("thing", tuple(range(len(meshes))), 25.0, lambda number: meshes[number])


def test_a_table_is_refused() -> None:
    legs = [((x, y, 0.35), (0.06, 0.06, 0.7)) for x in (-0.62, 0.62) for y in (-0.32, 0.32)]
    table = boxes(((0.0, 0.0, 0.72), (1.4, 0.8, 0.05)), *legs)
    assert "does not look like one person" in why_not(fit_capture(standing(table, table), workers=2))


def test_two_people_in_one_capture_are_refused() -> None:
    one, other = (open_capture(SCENES / "salsa_open" / who, name=who, fps=25) for who in "ab")

    def both(number: int) -> Mesh:
        a, b = one.mesh(number + 20), other.mesh(number + 20)
        shift = a.vertices.mean(0) - b.vertices.mean(0) + np.array([0.35, 0.0, 0.0])
        faces = np.concatenate([a.faces, b.faces + len(a.vertices)])
        return Mesh(np.concatenate([a.vertices, b.vertices + shift]), faces)

    fit = fit_capture(MeshSequence("both", (0, 4, 8), 25.0, both), workers=2)
    assert "does not look like one person" in why_not(fit)


def test_half_a_body_is_refused() -> None:
    whole = open_capture(SCENES / "greeting" / "a", name="a", fps=25)

    def torn(number: int) -> Mesh:
        mesh = whole.mesh(number)
        kept = mesh.faces[(mesh.vertices[mesh.faces, 2] > 0.75).all(1)]
        used, index = np.unique(kept, return_inverse=True)
        return Mesh(mesh.vertices[used], index.reshape(-1, 3).astype(np.int32))

    why = why_not(fit_capture(MeshSequence("torn", (0, 6, 12), 25.0, torn), workers=2))
    assert "left_foot has" in why
    assert "right_shin has" in why


def test_frames_that_are_not_met_are_named(figure_fit: tuple[CaptureFit, FloatArray]) -> None:
    fit, _ = figure_fit
    good, bad = FrameFit(0.002, 1.0, 1.0), FrameFit(0.03, 0.5, 0.9)
    (sentence,) = refusals(fit.likeness, [7, 8, 9, 12], [good, bad, bad, good])
    assert sentence.startswith("frames 8 to 9: 30.0 mm between template and capture")
    away = np.zeros((3, N_JOINTS, 3))
    away[2, joint("left_hand")] = 0.6
    assert jumps([4, 5, 6], np.zeros((3, N_JOINTS, 3)), fps=25.0) == ()
    assert jumps([4, 5, 6], away, fps=25.0) == ("left_hand moves at 26 m/s between frames 5 and 6, at most 12",)
    assert issubclass(FitRefused, MhveditError)
    assert "expected a capture that a skeleton fits" in str(FitRefused("anna", [sentence]))
    assert len(NAMES) == len(fit.likeness.shares)
