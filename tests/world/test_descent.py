import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.avoidance.posture import place
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import joint_frames, points_on_joints
from mhvedit.skeleton.model import Skeleton
from mhvedit.world.cones import (
    InCone,
    ReachCone,
    inside,
    into_cones,
    leaves_cone,
    limb_direction,
    load_cones,
    nearest_inside,
)
from mhvedit.world.descent import DescentSettings, Effector, descend, signed_angle
from mhvedit.world.figure import inward_dofs, load_avatar
from mhvedit.world.problems import WorldError

AVATAR = load_avatar()
SKELETON = AVATAR.skeleton
SEEDS = st.integers(0, 10_000)
HARD = DescentSettings(tolerance=1e-6, sweeps=200)


def arm(limit: float = np.pi) -> Skeleton:
    """Seven one-axis joints: shoulder 3, elbow 1, forearm 1, wrist 2."""
    names = ("shoulder", "elbow", "wrist", "tip")
    axes = np.eye(3)[[2, 1, 0, 2, 0, 2, 1]]
    return Skeleton(
        names,
        np.array([-1, 0, 1, 2]),
        np.array([[0.0, 0, 0], [0.3, 0, 0], [0.25, 0, 0], [0.1, 0, 0]]),
        np.array([0, 0, 0, 1, 1, 2, 2]),
        axes,
        np.zeros(7, np.bool_),
        np.tile([-limit, limit], (7, 1)),
        tuple(f"d{i}" for i in range(7)),
    )


@given(SEEDS)
def test_c3_3_the_angle_has_a_sign_and_is_that_in_the_joint_plane(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis, u = rng.normal(size=(2, 3))
    axis /= np.linalg.norm(axis)
    angle, along = rng.uniform(-3, 3), rng.normal()
    across = u - (axis @ u) * axis
    turned = np.cos(angle) * across + np.sin(angle) * np.cross(axis, across)
    assert signed_angle(axis, u, rng.uniform(0.1, 9) * turned + along * axis) == approx(angle, abs=1e-9)


@pytest.mark.parametrize("tiny", [1e-9, 1e-7, 1e-5])
def test_c3_3_small_angles_are_exact_where_arccos_gives_none(tiny: float) -> None:
    u = np.array([1.0, 0.0, 0.0])
    v = np.array([np.cos(tiny), -np.sin(tiny), 0.0])
    assert signed_angle(np.array([0.0, 0.0, 1.0]), u, v) == approx(-tiny, rel=1e-6)


def test_effectors_on_the_axis_do_not_turn() -> None:
    z = np.array([0.0, 0.0, 1.0])
    assert signed_angle(z, z, np.array([1.0, 0, 0])) == 0.0
    assert signed_angle(z, np.array([1.0, 0, 0]), np.zeros(3)) == 0.0


@pytest.mark.parametrize("shift", [0.02, 0.05, 0.1])
def test_nearly_all_shifts_of_some_centimetres_are_reached(shift: float) -> None:
    """The rest are at the edge of reach, where descent creeps: the reason why it does not stand alone."""
    rng, skeleton, reached = np.random.default_rng(0), arm(), 0
    for _ in range(100):
        q = rng.uniform(-1.2, 1.2, 7)
        q[3] = rng.uniform(0.5, 1.5)
        way = rng.normal(size=3)
        tip = points_on_joints(skeleton, q, np.array([3]), np.zeros((1, 3)))[0]
        goal = tip + shift * way / np.linalg.norm(way)
        found = descend(skeleton, q, Effector(3, np.zeros(3), goal), range(6, -1, -1), settings=HARD)
        after = points_on_joints(skeleton, found.q, np.array([3]), np.zeros((1, 3)))[0]
        assert np.linalg.norm(after - goal) == approx(found.residual, abs=1e-12)
        reached += found.residual < 1e-3
    assert reached >= 90


@given(SEEDS)
def test_residuals_never_grow_and_limits_hold(seed: int) -> None:
    rng = np.random.default_rng(seed)
    skeleton = arm(0.8)
    q = rng.uniform(-0.8, 0.8, 7)
    goal = rng.normal(0, 0.5, 3)
    last = np.inf
    for sweeps in (0, 1, 2, 4, 8):
        settings = DescentSettings(tolerance=0.0, sweeps=sweeps)
        found = descend(skeleton, q, Effector(3, np.zeros(3), goal), range(6, -1, -1), settings=settings)
        assert (np.abs(found.q) <= 0.8 + 1e-12).all()
        assert found.residual <= last + 1e-9
        last = found.residual


def test_a_goal_out_of_reach_stretches_the_arm_towards_it() -> None:
    found = descend(
        arm(), np.full(7, 0.3), Effector(3, np.zeros(3), np.array([0.0, 5.0, 0.0])), range(6, -1, -1), settings=HARD
    )
    assert found.residual == approx(5.0 - 0.65, abs=1e-3)
    assert found.sweeps == HARD.sweeps


def test_dofs_run_from_the_link_inwards_and_end_with_its_chain() -> None:
    hand = SKELETON.names.index("left_hand")
    joints = SKELETON.dof_joint[inward_dofs(AVATAR, hand)]
    assert (np.diff(joints) <= 0).all()
    assert {SKELETON.names[j] for j in joints} == {"left_hand", "left_forearm", "left_upper_arm", "left_clavicle"}
    assert len(inward_dofs(AVATAR, SKELETON.names.index("spine"))) == 0


CONES = load_cones(SKELETON)


def in_polygon_by_winding(cone: ReachCone, direction: FloatArray) -> bool:
    """Whether the polygon goes round a direction on a map of the sphere, stereographic from behind its middle."""
    across = np.linalg.svd(cone.seen_from[None])[2][1:]

    def on_map(points: FloatArray) -> FloatArray:
        return np.asarray((points @ across.T) / (1 + points @ cone.seen_from)[..., None])

    shares = np.linspace(0, 1, 200)[:, None]
    arcs = [a + shares * (b - a) for a, b in zip(cone.polygon, np.roll(cone.polygon, -1, axis=0), strict=True)]
    outline = np.concatenate(arcs)
    away = on_map(outline / np.linalg.norm(outline, axis=1, keepdims=True)) - on_map(direction[None])
    angles = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
    return bool(abs(angles[-1] - angles[0]) > np.pi)


def test_the_package_has_a_cone_for_each_shoulder_and_hip_and_rest_is_inside() -> None:
    assert sorted(SKELETON.names[cone.joint] for cone in CONES) == [
        "left_thigh", "left_upper_arm", "right_thigh", "right_upper_arm",
    ]  # fmt: skip
    rotations, _ = joint_frames(SKELETON, np.zeros(SKELETON.n_dofs))
    assert not leaves_cone(SKELETON, rotations, CONES)


@settings(max_examples=60)
@given(SEEDS, st.integers(0, 3))
def test_c3_5_inside_a_cone_is_inside_its_polygon(seed: int, which: int) -> None:
    direction = np.random.default_rng(seed).normal(size=3)
    direction /= np.linalg.norm(direction)
    assert inside(CONES[which], direction) == in_polygon_by_winding(CONES[which], direction)


@settings(max_examples=60)
@given(SEEDS, st.integers(0, 3))
def test_what_left_a_cone_goes_to_its_nearest_boundary_point(seed: int, which: int) -> None:
    cone, direction = CONES[which], np.random.default_rng(seed).normal(size=3)
    direction /= np.linalg.norm(direction)
    found = nearest_inside(cone, direction)
    assert np.linalg.norm(found) == approx(1.0)
    assert inside(cone, found)
    if inside(cone, direction):
        assert (found == direction).all()
        return
    shares = np.linspace(0, 1, 200)[:, None]
    edges = [a + shares * (b - a) for a, b in zip(cone.polygon, np.roll(cone.polygon, -1, axis=0), strict=True)]
    arcs = np.concatenate(edges)
    arcs /= np.linalg.norm(arcs, axis=1, keepdims=True)
    assert found @ direction >= (arcs @ direction).max() - 1e-5


def test_limbs_come_back_into_their_cones_and_twist_stays() -> None:
    q = np.zeros(SKELETON.n_dofs)
    q[SKELETON.dof_names.index("left_upper_arm.z")] = 1.0  # behind the back
    cone = next(cone for cone in CONES if SKELETON.names[cone.joint] == "left_upper_arm")
    before = limb_direction(SKELETON, q, cone)
    assert not inside(cone, before)
    after = into_cones(SKELETON, q, CONES)
    assert limb_direction(SKELETON, after, cone) == approx(nearest_inside(cone, before), abs=1e-5)
    others = SKELETON.dof_joint != cone.joint
    assert (after[others] == q[others]).all()


def test_the_row_of_a_cone_against_finite_differences() -> None:
    q = np.random.default_rng(1).uniform(-0.4, 0.4, SKELETON.n_dofs)
    for cone in CONES:
        constraint = InCone(cone)
        rows = constraint.rows(place(SKELETON, q))
        for dof in np.flatnonzero(SKELETON.dof_joint == cone.joint):
            step = np.zeros(SKELETON.n_dofs)
            step[dof] = 1e-6
            change = constraint.rows(place(SKELETON, q - step)).low - constraint.rows(place(SKELETON, q + step)).low
            assert rows.jacobian[0, dof] == approx(float(change[0]) / 2e-6, abs=1e-6)


def test_polygons_that_do_not_see_themselves() -> None:
    polygon = np.eye(3)
    with pytest.raises(WorldError, match="reach cone"):
        ReachCone(1, np.array([1.0, 0, 0]), polygon[::-1], np.ones(3) / np.sqrt(3))
