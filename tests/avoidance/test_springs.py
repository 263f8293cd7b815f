import numpy as np
import pytest
from scipy.optimize import minimize

from mhvedit.avoidance.springs import Course, Springs, Steps, least_cost_move
from mhvedit.geometry.arrays import FloatArray

F = 3  # DOFs
SCALE, PUSH, BRAKE = 2.0, 50.0, 30.0


def drawn(n: int, first: int, last: int) -> tuple[Course, Springs, Steps]:
    """A run of n frames; the motion begins `first` and ends `last` frames from the run, at most two."""
    rng = np.random.default_rng(n + first + last)
    there = np.array([*(k < first for k in (1, 0)), *[True] * n, *(k < last for k in (0, 1))])
    before = rng.normal(size=(n + 1, F))
    before[0, :] = before[0] if first else np.nan
    before[n, :] = before[n] if last else np.nan
    return (
        Course(rng.normal(size=(n + 4, F)), there, rng.uniform(1, 2, F), SCALE),
        Springs(np.arange(n), rng.normal(size=(n, F)), np.ones(n), np.full(n, 3.0), np.full(n, PUSH)),
        Steps(before, np.full(F, 0.5), BRAKE),
    )


def cost_of(move: FloatArray, course: Course, springs: Springs, steps: Steps) -> float:
    """What the docstrings promise, by definition."""
    change = course.change.copy()
    change[2:-2] += move
    whole = course.there[:-2] & course.there[1:-1] & course.there[2:]
    bends = change[:-2] - 2 * change[1:-1] + change[2:]
    value = (springs.jacobian * move[springs.frame]).sum(1)
    missed = np.maximum(springs.low - value, 0) ** 2 + np.maximum(value - springs.high, 0) ** 2
    step = steps.before + np.diff(np.pad(move, ((1, 1), (0, 0))), axis=0)
    size = (course.weights * change[2:-2] ** 2).sum()
    wiggle = SCALE**4 * (course.weights * bends[whole] ** 2).sum()
    return float(size + wiggle + PUSH * missed.sum() + BRAKE * np.nansum(np.maximum(np.abs(step) - 0.5, 0) ** 2))


@pytest.mark.parametrize(("n", "first", "last"), [(7, 2, 2), (7, 0, 2), (7, 2, 0), (5, 1, 1), (2, 2, 2), (1, 0, 0)])
def test_the_move_is_the_one_of_least_cost(n: int, first: int, last: int) -> None:
    drawing = drawn(n, first, last)
    move = least_cost_move(*drawing, updates=30)
    oracle = minimize(lambda x: cost_of(x.reshape(n, F), *drawing), np.zeros(n * F), options={"gtol": 1e-8})
    assert cost_of(move, *drawing) <= oracle.fun * (1 + 1e-6)
    assert np.allclose(move.ravel(), oracle.x, atol=1e-4)


def test_a_change_without_springs_goes_away() -> None:
    course, _, _ = drawn(6, 0, 0)
    none = Springs(np.zeros(0, np.int64), np.zeros((0, F)), np.zeros(0), np.zeros(0), np.zeros(0))
    move = least_cost_move(course, none, Steps(np.full((7, F), np.nan), np.ones(F), 1.0), updates=3)
    assert np.allclose(course.change[2:-2] + move, 0, atol=1e-9)
