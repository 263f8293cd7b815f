"""Every impulse, over random bodies, materials and contacts: momentum is kept and no energy is made (C4)."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.contacts import Contacts
from mhvedit.world.impulses import IMPACT, struck, supported
from mhvedit.world.motion import Moving, flown, kinetic_energy, rates, spins
from mhvedit.world.turning import turn

SEEDS = st.integers(0, 100_000)


def bodies(seed: int, n: int, *, fixed: int = 0) -> Moving:
    """Random bodies, some of them fixed."""
    rng = np.random.default_rng(seed)
    inverse_mass = 1 / rng.uniform(0.1, 10, n)
    half = rng.uniform(0.5, 2, (n, 3))
    moments = (half**2).sum(1)[:, None] - half**2
    inertia = np.einsum("ni,ij->nij", inverse_mass[:, None] / moments, np.eye(3))
    velocity, momentum = rng.normal(size=(2, n, 3))
    for array in (inverse_mass, inertia, velocity, momentum):
        array[n - fixed :] = 0
    rotations = np.array([turn(v) for v in rng.normal(0, 2, (n, 3))])
    return Moving(rotations, rng.normal(size=(n, 3)), velocity, momentum, np.zeros((n, 3)), inverse_mass, inertia)


def contacts(seed: int, n: int, n_frames: int, *, restitution: float, friction: float) -> Contacts:
    rng = np.random.default_rng(seed + 1)
    frames = np.array([rng.choice(n_frames, 2, replace=False) for _ in range(n)])
    normal = rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Contacts(frames, rng.normal(size=(n, 3)), normal, np.zeros(n), np.full(n, restitution), np.full(n, friction))


def approach(moving: Moving, touch: Contacts, velocity: FloatArray, momentum: FloatArray) -> FloatArray:
    """(N, 3) m/s, by the textbook."""
    after = Moving(
        moving.rotations, moving.positions, velocity, momentum, moving.spin, moving.inverse_mass, moving.inverse_inertia
    )
    spin, found = spins(after), []
    for (a, b), point in zip(touch.frames, touch.point, strict=True):
        of_a = velocity[a] + np.cross(spin[a], point - moving.positions[a])
        of_b = velocity[b] + np.cross(spin[b], point - moving.positions[b])
        found.append(of_a - of_b)
    return np.array(found)


def energy(moving: Moving, velocity: FloatArray, momentum: FloatArray) -> float:
    return kinetic_energy(
        Moving(
            moving.rotations,
            moving.positions,
            velocity,
            momentum,
            moving.spin,
            moving.inverse_mass,
            moving.inverse_inertia,
        )
    )


@given(SEEDS, st.floats(0, 1))
def test_c4_2_one_contact_comes_back_with_its_restitution(seed: int, restitution: float) -> None:
    moving = bodies(seed, 2)
    touch = contacts(seed, 1, 2, restitution=restitution, friction=0.0)
    before = float(approach(moving, touch, moving.velocity, moving.momentum)[0] @ touch.normal[0])
    after = float(approach(moving, touch, *struck(moving, touch))[0] @ touch.normal[0])
    assert after == approx(-restitution * before if before < -IMPACT else before, abs=1e-9)


@settings(max_examples=150)
@given(SEEDS, st.floats(0, 1), st.floats(0, 3), st.integers(1, 6), st.integers(0, 1))
def test_c4_4_impulses_never_add_energy_and_nothing_comes_nearer(
    seed: int, restitution: float, friction: float, n: int, fixed: int
) -> None:
    moving = bodies(seed, 4, fixed=fixed)
    touch = contacts(seed, n, 4, restitution=restitution, friction=friction)
    touch = Contacts(
        np.sort(touch.frames, axis=1),
        *(getattr(touch, k) for k in ("point", "normal", "gap", "restitution", "friction")),
    )
    velocity, momentum = struck(moving, touch)
    before, after = kinetic_energy(moving), energy(moving, velocity, momentum)
    assert after <= before * (1 + 1e-12) + 1e-12
    rate = np.einsum("ij,ij->i", approach(moving, touch, velocity, momentum), touch.normal)
    assert (rate >= -IMPACT - 1e-9).all() or after < 1e-6 * before


@example(39, 0.0, 3.0)  # sweeps end with nothing that presses
@given(SEEDS, st.floats(0, 1), st.floats(0, 3))
def test_both_momenta_are_kept(seed: int, restitution: float, friction: float) -> None:
    moving = bodies(seed, 3)
    touch = contacts(seed, 4, 3, restitution=restitution, friction=friction)

    def totals(velocity: FloatArray, momentum: FloatArray) -> FloatArray:
        linear = velocity / moving.inverse_mass[:, None]
        return np.concatenate([linear.sum(0), (np.cross(moving.positions, linear) + momentum).sum(0)])

    before = totals(moving.velocity, moving.momentum)
    assert totals(*struck(moving, touch)) == approx(before, abs=1e-9)
    velocity, momentum, _ = supported(moving, touch, np.zeros((3, 3)))
    assert totals(velocity, momentum) == approx(before, abs=1e-9)


@given(SEEDS, st.floats(0, 1), st.floats(0, 3))
def test_c4_4_friction_only_brakes(seed: int, restitution: float, friction: float) -> None:
    """One ball against a wall: what slides keeps its direction or stops, whatever the friction."""
    rng = np.random.default_rng(seed)
    moving = bodies(seed, 2, fixed=1)
    moving = Moving(
        moving.rotations, np.zeros((2, 3)), moving.velocity, moving.momentum, moving.spin, moving.inverse_mass,
        np.array([2.5 * moving.inverse_mass[0] * np.eye(3), np.zeros((3, 3))]),
    )  # fmt: skip
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    touch = Contacts(
        np.array([[0, 1]]), -normal[None], normal[None], np.zeros(1), np.full(1, restitution), np.full(1, friction)
    )
    before = approach(moving, touch, moving.velocity, moving.momentum)[0]
    after = approach(moving, touch, *struck(moving, touch))[0]
    slid, slides = (v - (v @ normal) * normal for v in (before, after))
    assert slides @ slid >= -1e-12
    assert np.linalg.norm(slides) <= np.linalg.norm(slid) + 1e-12
    if before @ normal < -IMPACT:
        j = -(1 + restitution) * (before @ normal) / moving.inverse_mass[0]
        assert np.linalg.norm(slid - slides) / (3.5 * moving.inverse_mass[0]) <= friction * j + 1e-9


def test_what_does_not_come_nearer_is_left_alone() -> None:
    moving = bodies(1, 2)
    touch = contacts(1, 1, 2, restitution=0.5, friction=0.5)
    speed = approach(moving, touch, moving.velocity, moving.momentum)[0] @ touch.normal[0]
    apart = Contacts(
        touch.frames, touch.point, np.sign(speed) * touch.normal, touch.gap, touch.restitution, touch.friction
    )
    velocity, momentum = struck(moving, apart)
    assert (velocity == moving.velocity).all() and (momentum == moving.momentum).all()


@given(SEEDS, st.floats(0, 2))
def test_support_pushes_and_does_not_pull(seed: int, friction: float) -> None:
    moving = bodies(seed, 3, fixed=1)
    touch = contacts(seed, 3, 3, restitution=0.3, friction=friction)
    velocity, momentum, pressed = supported(moving, touch, np.zeros((3, 3)))
    assert (pressed[:, 0] >= 0).all()
    assert (np.hypot(pressed[:, 1], pressed[:, 2]) <= friction * pressed[:, 0] + 1e-9).all()
    assert energy(moving, velocity, momentum) <= kinetic_energy(moving) + 1e-9


@settings(max_examples=20)
@given(SEEDS)
def test_a_tumbling_body_keeps_momentum_and_energy(seed: int) -> None:
    moving = bodies(seed, 2)
    before, momentum = kinetic_energy(moving), moving.momentum
    for _ in range(240):
        spin = rates(moving, momentum, 1 / 240)
        rotations, positions = flown(moving, moving.velocity, spin, 1 / 240)
        moving = Moving(
            rotations, positions, moving.velocity, momentum, moving.spin, moving.inverse_mass, moving.inverse_inertia
        )
    assert kinetic_energy(moving) == approx(before, rel=1e-5)
    assert moving.rotations @ np.swapaxes(moving.rotations, 1, 2) == approx(np.tile(np.eye(3), (2, 1, 1)), abs=1e-12)


def test_tumbling_is_of_fourth_order() -> None:
    def turned(steps: int) -> FloatArray:
        moving = bodies(3, 1)
        for _ in range(steps):
            rotations, _ = flown(moving, moving.velocity, rates(moving, 5 * moving.momentum, 1 / steps), 1 / steps)
            moving = Moving(
                rotations, moving.positions, moving.velocity, moving.momentum, moving.spin, moving.inverse_mass,
                moving.inverse_inertia,
            )  # fmt: skip
        return moving.rotations

    exact = turned(4000)
    errors = [np.abs(turned(steps) - exact).max() for steps in (20, 40, 80)]
    assert errors[0] / errors[1] > 12 and errors[1] / errors[2] > 12
