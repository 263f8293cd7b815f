import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import FloatArray
from mhvedit.optimise.steps import Places, cheapest_step, exactly

SEEDS = st.integers(0, 2**32 - 1)
SOME = settings(max_examples=60, derandomize=True)


def some_places(rng: np.random.Generator, count: int) -> Places:
    """In a cloud, on a line or in one place, known or not."""
    spread, unknown = rng.choice([0.0, 0.1, 3.0], 2), rng.choice([0.0, 0.5])
    middle = rng.normal(0, 1, count) * spread[0] + 1j * rng.normal(0, 1, count) * spread[1]
    slack = unknown * (rng.normal(0, 1, count) + 1j * rng.normal(0, 1, count))
    rest = middle + unknown * (rng.normal(0, 1, count) + 1j * rng.normal(0, 1, count))
    half, blur = (unknown * share * (rng.random(count) + 1j * rng.random(count)) for share in (1.0, 0.1))
    return Places(middle, half, rest, slack, blur)


def plain_steps(source: Places, target: Places) -> FloatArray:
    """(M, N) the greater of both bounds for every pair, by matrices."""
    out = np.empty((len(target.middle), len(source.middle)))
    for j, i in np.ndindex(out.shape):
        slacks = np.array([[p.real, p.imag] for p in (source.slack[i], target.slack[j])])
        middle, half = target.middle[j] - source.middle[i], target.half[j] + source.half[i]
        whole = least_in_box(complex(middle), complex(half), np.eye(2))
        way, blur = target.rest[j] - source.rest[i], target.blur[j] + source.blur[i]
        stiffness = np.linalg.inv(np.eye(2) + slacks.T @ slacks)
        slides = least_in_box(complex(way), complex(blur), stiffness)
        out[j, i] = 0.5 * max(whole, slides)
    return out


def least_in_box(middle: complex, half: complex, form: FloatArray) -> float:
    """The least of a quadratic form: 0, where the box holds the origin, or else on one of its four edges."""
    low = np.array([middle.real - half.real, middle.imag - half.imag])
    high = np.array([middle.real + half.real, middle.imag + half.imag])
    if (low <= 0).all() and (high >= 0).all():
        return 0.0
    found = []
    for axis, edge in itertools.product((0, 1), (low, high)):
        d = np.empty(2)
        d[axis], other = edge[axis], 1 - axis
        d[other] = np.clip(-form[axis, other] / form[other, other] * d[axis], low[other], high[other])
        found.append(float(d @ form @ d))
    return min(found)


def unlimited(count: int) -> FloatArray:
    return np.full(count, np.inf)


@given(SEEDS)
@SOME
def test_the_cheapest_step_is_the_least_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target = (some_places(rng, int(10 ** rng.uniform(0, 1.9))) for _ in range(2))
    left_out = rng.random(len(target.middle)) < 0.1
    value = rng.uniform(0, rng.choice([0.0, 1.0]), len(source.middle))
    budget = float(rng.choice([0.05, 0.5, np.inf]))
    every = value + plain_steps(source, target)
    wanted = ~left_out & (every.min(1) <= budget)
    least, nearest = cheapest_step(value, source, target, np.where(left_out, -1.0, budget))
    np.testing.assert_allclose(least, np.where(wanted, every.min(1), np.inf), rtol=1e-9, atol=1e-15)
    assert ((nearest >= 0) == wanted).all()
    np.testing.assert_allclose(every[wanted, nearest[wanted]], least[wanted], rtol=1e-9, atol=1e-15)
    within, budgets = np.where(every.min(1) <= budget, every.min(1), np.inf), np.full(len(wanted), budget)
    np.testing.assert_allclose(cheapest_step(value, source, target, budgets)[0], within, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_the_cheapest_of_many_sources_is_the_least_of_all(seed: int) -> None:
    """So many that boxes stand in boxes: known ones, and some that are not."""
    rng = np.random.default_rng(seed)
    source, target = (rng.normal(0, 1, count) + 1j * rng.normal(0, 1, count) for count in (9000, 50))
    value = rng.uniform(0, 10.0 ** -rng.integers(1, 5), 9000)
    least, _ = cheapest_step(value, exactly(source), exactly(target), unlimited(len(target)))
    np.testing.assert_allclose(least, (value + 0.5 * np.abs(target[:, None] - source) ** 2).min(1), rtol=1e-9)
    unknown, wanted = some_places(rng, 600), some_places(rng, 3)
    least, _ = cheapest_step(value[:600], unknown, wanted, unlimited(3))
    np.testing.assert_allclose(least, (value[:600] + plain_steps(unknown, wanted)).min(1), rtol=1e-9, atol=1e-15)


def test_every_target_has_its_own_budget() -> None:
    source, target = exactly(np.array([0j, 3j])), exactly(np.array([1j, 1j, 1j]))
    least, nearest = cheapest_step(np.array([0.0, 1.0]), source, target, np.array([0.5, 0.4, -1.0]))
    assert least.tolist() == [0.5, np.inf, np.inf] and nearest.tolist() == [0, -1, -1]


@given(SEEDS)
@SOME
def test_sliding_costs_no_less_than_the_step_says(seed: int) -> None:
    """Any two shares of the slacks that are taken, and any two places within the boxes besides."""
    rng = np.random.default_rng(seed)
    source, target = some_places(rng, 1), some_places(rng, 1)
    source, target = (Places(p.rest, p.half + (1 + 1j) * 1e9, p.rest, p.slack, p.blur) for p in (source, target))
    least = cheapest_step(np.zeros(1), source, target, unlimited(1))[0][0]
    shares = rng.normal(0, 10.0 ** rng.integers(-2, 2), (2, 200))
    across, along = rng.uniform(-1, 1, (2, 2, 200))
    ends = [
        p.rest + p.slack * s + p.blur.real * x + 1j * p.blur.imag * y
        for p, s, x, y in zip((source, target), shares, across, along, strict=True)
    ]
    cost = 0.5 * np.abs(ends[1] - ends[0]) ** 2 + 0.5 * (shares**2).sum(0)
    assert (cost >= least * (1 - 1e-9)).all()


@given(SEEDS)
@SOME
def test_slack_without_measure_leaves_the_cost_exact(seed: int) -> None:
    """Where turning costs next to nothing; beside fractions, in which nothing is rounded."""
    rng = np.random.default_rng(seed)
    arms = rng.normal(0, 1, 2) + 1j * rng.normal(0, 1, 2)
    if seed % 2:
        arms[1] = arms[0] * rng.normal()  # so that both slide alike
    slacks, way = 10.0 ** rng.uniform(0, 6, 2) * arms, complex(*rng.normal(0, 1, 2))
    slack, nowhere = np.array(slacks, np.complex128), np.zeros(1, np.complex128)
    anywhere = np.full(1, 1e9 * (1 + 1j))
    source = Places(nowhere, anywhere, nowhere, slack[:1], nowhere)
    target = Places(nowhere, nowhere, np.array([way]), slack[1:], nowhere)
    (sx, sy), (tx, ty), (x, y) = ((Fraction(z.real), Fraction(z.imag)) for z in (*slacks.tolist(), way))
    square = x * x + y * y + (sx * y - sy * x) ** 2 + (tx * y - ty * x) ** 2
    exact = square / (1 + sx * sx + sy * sy + tx * tx + ty * ty + (sx * ty - sy * tx) ** 2) / 2
    assert cheapest_step(np.zeros(1), source, target, unlimited(1))[0][0] == pytest.approx(float(exact), rel=1e-9)


def test_known_places_are_a_plain_way_apart() -> None:
    least, nearest = cheapest_step(
        np.array([1.0, 0.0]), exactly(np.array([0j, 3j])), exactly(np.array([1j])), unlimited(1)
    )
    assert least.tolist() == [1.5] and nearest.tolist() == [0]


def test_without_sources_nothing_is_reached() -> None:
    nowhere, somewhere = exactly(np.zeros(0, np.complex128)), exactly(np.zeros(2, np.complex128))
    least, nearest = cheapest_step(np.zeros(0), nowhere, somewhere, unlimited(2))
    assert np.isinf(least).all() and nearest.tolist() == [-1, -1]
