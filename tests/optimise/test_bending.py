import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx
from scipy.optimize import minimize

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.optimise.bending import Push, bent

RIGHT = np.array([1.0, 0.0])


def energy(weights: FloatArray, shift: FloatArray, delta: float) -> float:
    """Written out, frame by frame."""
    total = 0.0
    for k in range(1, len(shift) - 1):
        acceleration, speed = shift[k - 1] - 2 * shift[k] + shift[k + 1], (shift[k + 1] - shift[k - 1]) / 2
        total += delta * float(acceleration @ acceleration) + (1 - delta) * weights[k] * float(speed @ speed)
    return total


def free_between(people: int, n: int, start: int, stop: int) -> BoolArray:
    free = np.zeros((people, n), np.bool_)
    free[:, start:stop] = True
    return free


def test_nothing_asked_is_nothing_done() -> None:
    shifts, costs = bent(np.ones((2, 9)), free_between(2, 9, 2, 7), [], delta=0.5)
    assert not shifts.any() and not costs.any()


def test_two_share_the_way_and_key_frames_stay() -> None:
    free = free_between(2, 21, 4, 17)
    shifts, costs = bent(np.ones((2, 21)), free, [Push(10, 0, 1, RIGHT, 0.2)], delta=0.5)
    assert shifts[0, 10, 0] - shifts[1, 10, 0] == approx(0.2, abs=1e-3)
    np.testing.assert_allclose(shifts[0], -shifts[1], atol=1e-9)
    assert not shifts[~free].any() and not shifts[..., 1].any()
    assert costs[0] == approx(costs[1]) == approx(energy(np.ones(21), shifts[0], 0.5))


def test_who_is_held_does_not_move() -> None:
    free = free_between(2, 21, 4, 17)
    free[1] = False
    shifts, _ = bent(np.ones((2, 21)), free, [Push(10, 0, 1, RIGHT, 0.2)], delta=0.5)
    assert shifts[0, 10, 0] == approx(0.2, abs=1e-3) and not shifts[1].any()


def test_what_is_met_already_does_not_pull() -> None:
    pushes = [Push(10, 0, None, RIGHT, 0.2), Push(11, 0, None, RIGHT, 0.01)]
    shifts, _ = bent(np.ones((1, 21)), free_between(1, 21, 4, 17), pushes, delta=0.5)
    alone, _ = bent(np.ones((1, 21)), free_between(1, 21, 4, 17), pushes[:1], delta=0.5)
    np.testing.assert_allclose(shifts, alone, atol=1e-9)


@given(st.integers(0, 1000))
@settings(max_examples=5)
def test_no_cheaper_way_does_what_is_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, weights = 14, rng.random((2, 14))
    free = free_between(2, n, 3, 12)
    pushes = []
    for k in rng.choice(np.arange(4, 11), 2, replace=False):
        angle = rng.random() * 6
        pushes.append(Push(int(k), 0, 1, np.array([np.cos(angle), np.sin(angle)]), float(rng.uniform(0.05, 0.2))))
    _, costs = bent(weights, free, pushes, delta=0.4)

    def spread(values: FloatArray) -> FloatArray:
        shifts = np.zeros((2, n, 2))
        shifts[free] = values.reshape(-1, 2)
        return shifts

    def cost(values: FloatArray) -> float:
        return sum(energy(w, s, 0.4) for w, s in zip(weights, spread(values), strict=True))

    asked = [
        {
            "type": "ineq",
            "fun": lambda values, p=p: (spread(values)[0] - spread(values)[1])[p.frame] @ p.direction - p.least,
        }
        for p in pushes
    ]
    least = minimize(cost, np.zeros(2 * int(free.sum())), constraints=asked, method="SLSQP", options={"maxiter": 300})
    assert least.success and costs.sum() == approx(float(least.fun), rel=2e-2)
