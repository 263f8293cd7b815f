import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.avoidance.retime import retimed
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Motion


@given(st.integers(0, 10**6), st.floats(0.5, 20.0))
def test_b10_no_dof_is_faster_than_allowed(seed: int, speed: float) -> None:
    rng = np.random.default_rng(seed)
    motion = Motion(np.cumsum(rng.normal(0, 0.1, (30, 3)), axis=0), 30.0)
    found = retimed(motion, np.full(3, speed))
    assert np.abs(np.diff(found.q, axis=0)).max() * 30 <= speed * (1 + 1e-9)
    assert np.allclose(found.q[[0, -1]], motion.q[[0, -1]])
    assert found.n_frames >= motion.n_frames


def test_b10_a_slow_motion_is_left_alone() -> None:
    motion = Motion(np.linspace(0, 1, 10)[:, None] * np.ones(2), 10.0)
    assert retimed(motion, np.full(2, 2.0)) is motion
    assert retimed(motion, np.array([2.0, np.inf])) is motion


def test_b10_half_the_speed_takes_twice_the_time() -> None:
    motion = Motion(np.linspace(0, 1, 11)[:, None], 10.0)
    assert retimed(motion, np.array([0.5])).n_frames == 21


@pytest.mark.parametrize("speeds", [np.ones(3), np.array([1.0, 0.0])])
def test_speeds_that_cannot_be_are_refused(speeds: FloatArray) -> None:
    with pytest.raises(ShapeError, match="speeds"):
        retimed(Motion(np.zeros((4, 2)), 30.0), speeds)
