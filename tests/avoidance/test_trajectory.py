import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.avoidance.trajectory import (
    Curve,
    Ends,
    KeyDisplacements,
    constraint_trajectory,
    displacement_curve,
    keys_through,
)
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray

KEY = np.array([[0.1, -0.2, 0.3]])


def keys(scope: tuple[int, int], *frames: int, seed: int = 0) -> KeyDisplacements:
    return KeyDisplacements(scope, np.array(frames), np.random.default_rng(seed).normal(0, 0.1, (len(frames), 3)))


@pytest.mark.parametrize("curve", Curve)
@pytest.mark.parametrize("ends", Ends)
def test_a1_2_every_curve_goes_through_its_keys(curve: Curve, ends: Ends) -> None:
    given_keys = keys((3, 40), 7, 12, 30)
    found = displacement_curve(given_keys, curve=curve, ends=ends)
    assert np.allclose(found[given_keys.frames - 3], given_keys.displacements, atol=1e-12)
    assert found.shape == (38, 3)


@pytest.mark.parametrize("curve", Curve)
def test_a1_3_ends_are_zero_and_join_the_unedited_frames(curve: Curve) -> None:
    found = displacement_curve(keys((3, 40), 7, 12, 30), curve=curve)
    assert np.abs(found[[0, -1]]).max() < 1e-12


@pytest.mark.parametrize("curve", [Curve.CLAMPED, Curve.PCHIP, Curve.CATMULL_ROM])
def test_a1_3_cubics_leave_and_join_without_slope(curve: Curve) -> None:
    """A long scope, so that a frame is a small step: the first step is of second order."""
    found = displacement_curve(KeyDisplacements((0, 1000), np.array([500]), KEY), curve=curve)
    assert np.abs(found[1] - found[0]).max() < 0.01 * np.abs(np.diff(found, axis=0)).max()


def test_a1_3_one_key_is_a_hat_or_a_constant() -> None:
    one = KeyDisplacements((10, 30), np.array([20]), KEY)
    hat = displacement_curve(one, curve=Curve.LINEAR)
    assert np.allclose(hat, (1 - np.abs(np.arange(-10, 11)) / 10)[:, None] * KEY)
    assert np.allclose(displacement_curve(one, curve=Curve.CLAMPED, ends=Ends.FREE), KEY)


@given(st.integers(0, 1000))
def test_a1_3_pchip_stays_between_its_keys(seed: int) -> None:
    given_keys = keys((0, 60), 5, 20, 21, 50, seed=seed)
    found = displacement_curve(given_keys, curve=Curve.PCHIP)
    low, high = np.minimum(given_keys.displacements.min(0), 0), np.maximum(given_keys.displacements.max(0), 0)
    assert (found >= low - 1e-12).all()
    assert (found <= high + 1e-12).all()


def test_a1_2_the_trajectory_is_the_captured_path_displaced() -> None:
    """M(t_k) is where the editor wants it, and the detail of the captured path is still there between the keys."""
    rng = np.random.default_rng(0)
    captured = rng.normal(size=(50, 3))
    wanted = {20: np.array([1.0, 2.0, 3.0]), 31: np.array([0.0, 0.5, 0.0])}
    found = constraint_trajectory(captured, keys_through(captured, (10, 40), wanted), curve=Curve.NATURAL)
    assert np.allclose(found[10], wanted[20])
    assert np.allclose(found[21], wanted[31])
    smooth = found - captured[10:41]
    assert np.abs(np.diff(smooth, 2, axis=0)).max() < 0.2 * np.abs(np.diff(captured, 2, axis=0)).max()


@pytest.mark.parametrize("frames", [(), (5, 5), (9, 3), (2, 6), (6, 12)])
def test_keys_must_be_increasing_and_in_scope(frames: tuple[int, ...]) -> None:
    values: FloatArray = np.zeros((len(frames), 3))
    with pytest.raises(ShapeError, match="increasing frames from 3 to 10"):
        KeyDisplacements((3, 10), np.array(frames, np.int64), values)
