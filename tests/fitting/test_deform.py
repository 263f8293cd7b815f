"""Carrying a change of the skeleton over to the captured surface."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from mhvedit.fitting.body import BodyInMotion, body_in_motion, grown
from mhvedit.fitting.capture import CaptureFit, fit_capture
from mhvedit.fitting.deform import BoneFrames, deformed, transferred_weights
from mhvedit.fitting.fit import Pose, joint_places
from mhvedit.fitting.joints import NAMES, joint
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.meshes import Mesh
from tests.fitting.figures import walking

SAME = np.ones(len(NAMES))


@pytest.fixture(scope="module")
def fitted() -> tuple[CaptureFit, Mesh, BoneFrames]:
    sequence, _ = walking(4)
    fit = fit_capture(sequence, workers=2)
    return fit, sequence.mesh(3), BoneFrames(fit.rotations[3], fit.places[3])


def raised(fit: CaptureFit, frames: BoneFrames, angle: float) -> BoneFrames:
    """The right forearm, with the hand, turned about the elbow."""
    turn = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    turns = frames.turns.copy()
    for name in ("right_forearm", "right_hand"):
        turns[joint(name)] = turn @ turns[joint(name)]
    return BoneFrames(turns, joint_places(fit.template.rest, Pose(turns, frames.places[0])))


def test_a_frame_that_is_not_edited_is_the_same_bit_for_bit(fitted: tuple[CaptureFit, Mesh, BoneFrames]) -> None:
    fit, mesh, frames = fitted
    assert deformed(mesh, fit.template, frames, frames, girth=SAME) is mesh


def test_only_what_hangs_on_a_joint_follows_it(fitted: tuple[CaptureFit, Mesh, BoneFrames]) -> None:
    fit, mesh, frames = fitted
    after = raised(fit, frames, 0.3)
    moved = deformed(mesh, fit.template, frames, after, girth=SAME)
    weights = transferred_weights(mesh, fit.template, frames)
    arm = weights[:, [joint("right_forearm"), joint("right_hand")]].sum(1)
    far = np.linalg.norm(moved.vertices - mesh.vertices, axis=1)
    assert far[arm == 0.0].max() < 1e-12
    assert far[arm > 0.99].max() > 0.04
    assert (moved.faces == mesh.faces).all()


def test_there_and_back_is_where_it_was(fitted: tuple[CaptureFit, Mesh, BoneFrames]) -> None:
    fit, mesh, frames = fitted
    after = raised(fit, frames, 0.3)
    moved = deformed(mesh, fit.template, frames, after, girth=SAME)
    back = deformed(moved, fit.template, after, frames, girth=SAME)
    assert np.percentile(np.linalg.norm(back.vertices - mesh.vertices, axis=1), 95) < 0.004


def test_girth_grows_limbs_and_not_bones(fitted: tuple[CaptureFit, Mesh, BoneFrames]) -> None:
    fit, mesh, frames = fitted
    girth = SAME.copy()
    girth[joint("left_shin")] = 1.3
    wide = deformed(mesh, fit.template, frames, frames, girth=girth)
    shin = transferred_weights(mesh, fit.template, frames)[:, joint("left_shin")] > 0.999
    before, after = (_from_bone(each.vertices[shin], frames) for each in (mesh, wide))
    assert_allclose(after, 1.3 * before, rtol=0.02)


def test_the_body_at_rest_grows_alike(fitted: tuple[CaptureFit, Mesh, BoneFrames]) -> None:
    fit, _, _ = fitted
    moving: BodyInMotion = body_in_motion(fit, fps=25.0)
    wide = grown(moving, fit.template, np.full(len(NAMES), 1.2))
    assert_allclose(grown(moving, fit.template, SAME).body.vertices, moving.body.vertices, atol=1e-9)
    assert np.ptp(wide.body.vertices[:, 1]) > 1.1 * np.ptp(moving.body.vertices[:, 1])
    assert replace(wide, body=moving.body).motion is moving.motion


def _from_bone(points: FloatArray, frames: BoneFrames) -> FloatArray:
    knee, ankle = frames.places[joint("left_shin")], frames.places[joint("left_foot")]
    bone = (ankle - knee) / np.linalg.norm(ankle - knee)
    away = points - knee
    return np.asarray(np.linalg.norm(away - np.outer(away @ bone, bone), axis=1))
