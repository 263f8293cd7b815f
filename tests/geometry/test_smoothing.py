"""Smoothing against SciPy's filter."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from mhvedit.geometry.smoothing import smoothed


@pytest.mark.parametrize("shape", [(1,), (3, 2), (60,), (60, 2), (41, 2, 3)])
@pytest.mark.parametrize("width", [0.0, 0.1, 0.5, 4.0, 7.3])
def test_it_is_what_scipy_finds(shape: tuple[int, ...], width: float) -> None:
    values = np.random.default_rng(1).normal(size=shape)
    expected = values if width == 0 else gaussian_filter1d(values, width, axis=0, mode="nearest")
    np.testing.assert_allclose(smoothed(values, width), expected, atol=1e-14)
