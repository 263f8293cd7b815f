import numpy as np
from numpy.testing import assert_allclose

from mhvedit.scene.edit import SubjectEdit
from mhvedit.scene.eyes import eyes_in
from mhvedit.sequences.meshes import Gaze


def test_eyes_are_those_of_each_frame_s_own_source() -> None:
    gaze = Gaze(np.array([3, 4, 7]), np.array([[0.1, 0.2, 1.6], [0.3, 0.2, 1.5], [0.0, 0.5, 1.0]]), np.eye(3))
    placements = np.array([[1.0, 2.0, 0.0], [1.0, 2.0, np.pi / 2], [0.0, 0.0, 1.0], [5.0, 0.0, np.pi]])
    eyes = eyes_in("anna", SubjectEdit(np.array([4, 4, 5, 3]), placements), gaze)
    assert_allclose(eyes.eye, [[1.3, 2.2, 1.5], [0.8, 2.3, 1.5], [np.nan] * 3, [4.9, -0.2, 1.6]])
    ways = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [np.nan] * 3, [-1.0, 0.0, 0.0]]
    assert_allclose(eyes.direction, ways, atol=1e-12)


def test_nobody_looks_where_there_is_no_gaze() -> None:
    nothing = Gaze(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    eyes = eyes_in("anna", SubjectEdit(np.array([1, 2]), np.zeros((2, 3))), nothing)
    assert np.isnan(eyes.eye).all() and np.isnan(eyes.direction).all()
