"""Band systems against dense and SciPy's solvers."""

import numpy as np
import pytest
from scipy.linalg import solveh_banded

from mhvedit.geometry.band import band_solution, solve_band


@pytest.mark.parametrize(("n", "k"), [(30, 7), (30, 1), (30, 0), (4, 7), (1, 2)])
def test_systems_are_solved(n: int, k: int) -> None:
    rng = np.random.default_rng(0)
    full = rng.normal(size=(n, n))
    full = np.where(np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= k, full + full.T, 0) + 20 * np.eye(n)
    band = np.array([[full[i, i - k + m] if i - k + m >= 0 else 0.0 for m in range(k + 1)] for i in range(n)])
    right = rng.normal(size=(n, 3))
    solution = right.copy()
    assert solve_band(band.copy(), solution)
    np.testing.assert_allclose(full @ solution, right, atol=1e-12)
    assert not solve_band(-band, right.copy())
    diagonals = np.array([np.append(np.diagonal(full, -o), np.full(min(o, n), np.nan)) for o in range(k + 1)])
    np.testing.assert_allclose(band_solution(diagonals, right), solution, atol=1e-13)
    if k < n:
        np.testing.assert_allclose(solveh_banded(np.nan_to_num(diagonals), right, lower=True), solution, atol=1e-13)
    with pytest.raises(ValueError, match="positive definite"):
        band_solution(-diagonals, right)
