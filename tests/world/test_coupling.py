import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytest import approx
from scipy.linalg import expm

from mhvedit.world.coupling import Coupling, coupled
from mhvedit.world.problems import WorldError

MASSES = st.floats(1e-3, 1e3)


@given(mass=MASSES, time=st.floats(0.0, 2.0), damping=st.floats(0.0, 200.0))
def test_c4_1_it_is_the_solution_of_the_equation(mass: float, time: float, damping: float) -> None:
    coupling = Coupling(1000.0, damping)
    x, v = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0])
    matrix = np.array([[0.0, 1.0], [-1000.0 / mass, -damping / mass]])
    expected = expm(time * matrix) @ np.stack([x, v])
    found = coupled(x, v, mass=mass, time=time, coupling=coupling)
    assert found[0] == approx(expected[0], abs=1e-6, rel=1e-6)
    assert found[1] == approx(expected[1], abs=1e-4, rel=1e-5)


def test_the_papers_values_are_critically_damped_for_400_grams() -> None:
    x, still = np.array([0.1, 0.0, 0.0]), np.zeros(3)
    times = np.linspace(0, 1, 200)

    def offsets(mass: float) -> list[float]:
        return [float(coupled(x, still, mass=mass, time=t, coupling=Coupling())[0][0]) for t in times]

    assert min(offsets(0.4)) >= 0.0 and min(offsets(0.41)) < 0.0
    rate = 50.0
    assert offsets(0.4) == approx(0.1 * (1 + rate * times) * np.exp(-rate * times), abs=1e-9)


@given(mass=MASSES, first=st.floats(0, 0.5), second=st.floats(0, 0.5))
def test_two_steps_are_one(mass: float, first: float, second: float) -> None:
    x, v = np.array([0.1, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    half = coupled(x, v, mass=mass, time=first, coupling=Coupling())
    found = coupled(*half, mass=mass, time=second, coupling=Coupling())
    whole = coupled(x, v, mass=mass, time=first + second, coupling=Coupling())
    assert found[0] == approx(whole[0], abs=1e-6) and found[1] == approx(whole[1], abs=1e-4)


@pytest.mark.parametrize(("mass", "time"), [(0.0, 0.1), (-1.0, 0.1), (np.nan, 0.1), (1.0, -0.1), (1.0, np.inf)])
def test_masses_and_times_that_cannot_be(mass: float, time: float) -> None:
    with pytest.raises(WorldError, match="expected"):
        coupled(np.zeros(3), np.zeros(3), mass=mass, time=time, coupling=Coupling())


def test_a_spring_pulls() -> None:
    with pytest.raises(WorldError, match="a positive stiffness"):
        Coupling(0.0, 1.0)
