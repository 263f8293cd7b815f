"""Closed forms: bounces, inclines, exchanges, rest; and fast balls that meet thin walls."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.motion import kinetic_energy, potential_energy
from mhvedit.world.pieces import box, capsule, ellipsoid
from mhvedit.world.simulate import Simulation
from mhvedit.world.world import State, Tracked, World, start
from tests.world.things import GAP, at, ball, cube, fixed, floor, played, simulated, surfaces

FEW = settings(max_examples=8)
MASSES = st.floats(0.05, 50)


def energy(world: World, state: State) -> float:
    gravity = np.array(world.gravity)
    return kinetic_energy(state.moving) + potential_energy(state.moving, gravity)


def index(world: World, name: str) -> int:
    return [body.name for body in world.bodies].index(name)


def path(world: World, states: list[State], name: str) -> FloatArray:
    return np.array([state.moving.positions[index(world, name)] for state in states])


@FEW
@given(restitution=st.floats(0.2, 1.0), mass=MASSES)
def test_a_ball_bounces_to_e_squared_h(restitution: float, mass: float) -> None:
    world = World((floor(), ball(mass=mass)), surfaces(restitution, 0.3))
    height, fps = 1.0, 240.0
    flight = np.sqrt(2 * height / 9.81)
    states, _ = played(
        world, {"floor": at(0, 0, 0), "ball": at(0, 0, 0.1 + height)}, 1.9 * flight * restitution + flight, fps=fps
    )
    z = path(world, states, "ball")[:, 2] - 0.1
    top = z[int(flight * fps) + 1 :].max()
    seen_late = 9.81 / 8 / fps**2  # the top lies between two frames
    assert top == approx(restitution**2 * height, abs=2e-4 + seen_late)


@FEW
@given(degrees=st.floats(5, 45), friction=st.floats(0.0, 1.0), mass=MASSES)
def test_a_box_on_an_incline_slides_or_sticks(degrees: float, friction: float, mass: float) -> None:
    slope = np.radians(degrees)
    gravity = (9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope))
    world = World((floor(), simulated("box", [cube(0.1)], mass)), surfaces(0.0, friction), gravity=gravity)
    states, _ = played(world, {"floor": at(0, 0, 0), "box": at(0, 0, 0.1 + GAP)}, 0.5)
    expected = max(0.0, 9.81 * (np.sin(slope) - friction * np.cos(slope)))
    tips = friction > 1.0 and np.tan(slope) > 1.0
    assert not tips
    near = 5e-4 if abs(np.tan(slope) - friction) < 0.03 else 1e-6  # impulses settle slowly at the edge of the cone
    assert path(world, states, "box")[-1, 0] == approx(expected * 0.125, abs=near)
    assert states[-1].moving.velocity[index(world, "box"), 0] == approx(expected * 0.5, abs=near)


@FEW
@given(first=MASSES, second=MASSES, speed=st.floats(0.5, 20), restitution=st.floats(0, 1))
def test_two_balls_exchange_momentum(first: float, second: float, speed: float, restitution: float) -> None:
    world = World((ball("a", mass=first), ball("b", mass=second)), surfaces(restitution, 0.3), gravity=(0.0, 0.0, 0.0))
    poses = {"a": at(-0.5, 0, 0), "b": at(0.5, 0, 0)}
    states, _ = played(world, poses, 0.8 / speed + 0.1, velocities={"a": np.array([speed, 0, 0])})
    after = states[-1].moving.velocity[:, 0]
    shared = first * speed / (first + second)
    assert after[0] == approx(shared - restitution * second * speed / (first + second), abs=1e-6)
    assert after[1] == approx(shared + restitution * first * speed / (first + second), abs=1e-6)


@FEW
@given(friction=st.floats(0.1, 1.0), mass=MASSES)
def test_a_sliding_ball_comes_to_roll_at_five_sevenths(friction: float, mass: float) -> None:
    world = World((floor(), ball(mass=mass)), surfaces(0.0, friction))
    poses = {"floor": at(0, 0, 0), "ball": at(0, 0, 0.1 + GAP)}
    states, _ = played(world, poses, 2 / (7 * friction * 9.81) + 0.3, velocities={"ball": np.array([1.0, 0, 0])})
    assert states[-1].moving.velocity[index(world, "ball"), 0] == approx(5 / 7, abs=1e-3)
    spin = states[-1].moving.momentum[index(world, "ball"), 1] / (0.4 * mass * 0.01)
    assert spin == approx(5 / 7 / 0.1, rel=2e-3)


@pytest.mark.parametrize("thickness", [0.001, 0.01, 0.1])
@pytest.mark.parametrize("speed", [5.0, 50.0, 500.0])
def test_a_fast_ball_does_not_pass_a_wall(thickness: float, speed: float) -> None:
    wall = fixed("wall", [box(np.array([0.0, -2, -2]), np.array([thickness, 2, 2]))])
    world = World((wall, ball(radius=0.05)), surfaces(0.5, 0.0), gravity=(0.0, 0.0, 0.0))
    states, _ = played(
        world, {"wall": at(0, 0, 0), "ball": at(-0.5, 0, 0)}, 0.2, velocities={"ball": np.array([speed, 0, 0])}
    )
    x = path(world, states, "ball")[:, 0]
    assert x.max() <= -0.05
    assert states[-1].moving.velocity[index(world, "ball"), 0] == approx(-speed / 2, rel=1e-6)


def test_a_spinning_rod_meets_a_wall_with_its_tip() -> None:
    rod = simulated("rod", [capsule(np.array([0.0, -0.5, 0]), np.array([0.0, 0.5, 0]), 0.01)])
    wall = fixed("wall", [box(np.array([0.2, -2, -2]), np.array([0.21, 2, 2]))])
    world = World((rod, wall), surfaces(0.5, 0.0), gravity=(0.0, 0.0, 0.0))
    state = start(world, {"rod": at(0, 0, 0), "wall": at(0, 0, 0)})
    state.moving.momentum[0, 2] = rod.inertia[2, 2] * 40.0
    simulation = Simulation(world)
    for _ in range(30):
        state, report = simulation.step(state, Tracked(), 1 / 60)
        assert report.deepest < 5e-4
    assert state.moving.momentum[0, 2] < rod.inertia[2, 2] * 40.0 and state.moving.velocity[0, 0] < 0


def test_a_pile_stands_for_10_s_without_drift() -> None:
    boxes = [simulated(f"box{i}", [cube(0.1)]) for i in range(4)]
    world = World((floor(), *boxes), surfaces(0.3, 0.3))
    poses = {"floor": at(0, 0, 0)} | {f"box{i}": at(0.01 * i, 0, 0.1 + GAP + (0.2 + GAP) * i) for i in range(4)}
    states, reports = played(world, poses, 10.0, fps=30.0)
    settled, last = states[30].moving, states[-1].moving
    assert np.abs(last.positions - settled.positions).max() < 1e-9
    assert np.abs(last.rotations - settled.rotations).max() < 1e-9
    assert np.abs(last.positions - states[0].moving.positions).max() < 5e-4
    assert max(report.deepest for report in reports) == 0.0


@pytest.mark.parametrize("name", ["ellipsoid", "capsule", "two boxes"])
def test_energy_never_grows(name: str) -> None:
    pieces = {
        "ellipsoid": [ellipsoid(np.zeros(3), np.diag([0.1, 0.15, 0.2]))],
        "capsule": [capsule(np.array([-0.2, 0, 0]), np.array([0.2, 0, 0]), 0.05)],
        "two boxes": [box(np.zeros(3), np.array([0.3, 0.1, 0.1])), box(np.zeros(3), np.array([0.1, 0.3, 0.1]))],
    }[name]
    thing = simulated("thing", pieces)
    world = World((floor(), thing), surfaces(0.6, 0.4))
    states, reports = played(
        world, {"floor": at(0, 0, 0), "thing": at(0, 0, 0.6)}, 3.0, velocities={"thing": np.array([1.5, 0.3, 0])}
    )
    ledger = np.array([energy(world, state) for state in states])
    lifted = 9.81 * 1e-3  # J: what sinks in by rounding is lifted out by less than a millimetre
    assert np.diff(ledger).max() < lifted and ledger[-1] < ledger[0]
    assert max(report.deepest for report in reports) < 1e-3


def test_free_flight_keeps_energy_to_the_last_digit() -> None:
    thing = simulated("thing", [ellipsoid(np.zeros(3), np.diag([0.1, 0.15, 0.2]))])
    world = World((thing,), surfaces(0.6, 0.4))
    states, _ = played(world, {"thing": at(0, 0, 0)}, 1.0, velocities={"thing": np.array([1.5, 0.3, 5.0])})
    ledger = np.array([energy(world, state) for state in states])
    assert ledger == approx(np.full(len(ledger), ledger[0]), rel=1e-12)
    expected = np.array([1.5, 0.3, 5.0 - 9.81 / 2])
    assert states[-1].moving.positions[0] - states[0].moving.positions[0] == approx(expected, abs=1e-9)
