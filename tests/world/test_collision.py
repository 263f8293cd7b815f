import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.broad import boxes, colliders_of, near_pairs, overlapping
from mhvedit.world.narrow import Narrow
from mhvedit.world.pieces import box, capsule, ellipsoid, sphere
from mhvedit.world.turning import between, turn, turn_vector
from mhvedit.world.world import World, start
from tests.world.independent import deepest, judge_of, touching_pairs
from tests.world.things import MATERIALS, at, simulated

PIECES = (
    sphere(0.1),
    capsule(np.zeros(3), np.array([0.3, 0.1, 0.0]), 0.05),
    box(np.array([-0.1, -0.2, -0.3]), np.array([0.1, 0.2, 0.1])),
    ellipsoid(np.zeros(3), np.diag([0.1, 0.2, 0.05])),
)
SEEDS = st.integers(0, 10_000)


def placed(seed: int, n: int, spread: float) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    return np.array([turn(v) for v in rng.normal(0, 2, (n, 3))]), rng.normal(0, spread, (n, 3))


@given(SEEDS)
def test_sweeping_finds_all_pairs_of_boxes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 1, (12, 3))
    found = np.stack([low, low + rng.uniform(0, 0.4, (12, 3))], 1)
    may = rng.uniform(size=(12, 12)) < 0.7
    may &= may.T
    reach = float(rng.uniform(0, 0.1))
    pairs = [(int(a), int(b)) for a, b in overlapping(found, may, reach)]
    assert pairs == sorted(touching_pairs(found, may, reach))


def test_boxes_hold_all_points() -> None:
    rotations, positions = placed(3, len(PIECES), 1.0)
    colliders = colliders_of(PIECES, np.arange(len(PIECES)), ~np.eye(len(PIECES), dtype=bool))
    for piece, turned, place, (low, high) in zip(
        PIECES, rotations, positions, boxes(colliders, rotations, positions), strict=True
    ):
        points = piece.points @ turned.T + place
        assert low == approx(points.min(0) - piece.radius)
        assert high == approx(points.max(0) + piece.radius)


@settings(max_examples=40)
@given(SEEDS)
def test_depth_is_what_separates_and_normals_point_out_of_b_into_a(seed: int) -> None:
    rotations, positions = placed(seed, len(PIECES), 0.05)
    narrow = Narrow(colliders_of(PIECES, np.arange(len(PIECES)), ~np.eye(len(PIECES), dtype=bool)))
    gaps = narrow.near(rotations, positions, reach=0.0)
    for k in range(len(gaps.distance)):
        moved = positions.copy()
        moved[gaps.pairs[k, 0]] -= gaps.distance[k] * gaps.normal[k]
        assert abs(narrow.gaps(gaps.pairs[k : k + 1], rotations, moved).distance[0]) < 2e-5
        assert np.linalg.norm(gaps.at_a[k] - gaps.at_b[k]) == approx(-gaps.distance[k], abs=2e-5)


@settings(max_examples=30)
@given(seed=SEEDS, wanted=st.floats(5e-4, 3e-3))
def test_fcl_sees_overlap_and_no_longer_after_the_depth_is_taken_back(seed: int, wanted: float) -> None:
    rotations, positions = placed(seed, 2, 0.06)
    rng = np.random.default_rng(seed)
    chosen = zip("ab", rng.integers(0, len(PIECES), 2), strict=True)
    world = World(tuple(simulated(name, [PIECES[i]]) for name, i in chosen), MATERIALS)
    pieces = tuple(body.pieces[0] for body in world.bodies)
    narrow = Narrow(colliders_of(pieces, np.arange(2), ~np.eye(2, dtype=bool)))
    pair = np.array([[0, 1]])
    gaps = narrow.gaps(pair, rotations, positions)
    positions[0] -= (gaps.distance[0] + wanted) * gaps.normal[0]
    state = start(world, {"a": at(0, 0, 0), "b": at(0, 0, 0)})
    state.moving.rotations[:], state.moving.positions[:] = rotations, positions
    judge = judge_of(world)
    assert deepest(judge, state) >= 0.9 * wanted  # the least depth; fcl finds a way out that may be longer
    state.moving.positions[0] += (wanted + 1e-4) * gaps.normal[0]
    assert deepest(judge, state) == 0.0


def test_a_box_stands_on_four_points_and_a_ball_on_one() -> None:
    pieces = (box(np.array([-1.0, -1, -1]), np.array([1.0, 1, 0])), box(-np.full(3, 0.1), np.full(3, 0.1)), sphere(0.1))
    narrow = Narrow(colliders_of(pieces, np.arange(3), ~np.eye(3, dtype=bool)))
    places = np.array([[0.0, 0, 0], [0.3, 0.2, 0.1001], [-0.3, 0, 0.1001]])
    turns = np.repeat(np.eye(3)[None], 3, axis=0)
    pairs = near_pairs(narrow.colliders, turns, places, reach=2e-4)
    rows, points, normals, gaps = narrow.patches(pairs, turns, places, reach=2e-4)
    assert sorted(rows.tolist()) == [0, 0, 0, 0, 1]
    assert np.sort(points[rows == 0][:, 0]) == approx([0.2, 0.2, 0.4, 0.4], abs=1e-6)
    assert normals == approx(np.tile([0.0, 0.0, -1.0], (5, 1)), abs=1e-6)
    assert gaps == approx(np.full(5, 1e-4), abs=1e-6)


@given(SEEDS)
def test_rotation_vectors_there_and_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vector = rng.normal(size=3)
    vector *= rng.uniform(0, np.pi) / np.linalg.norm(vector)
    assert turn_vector(turn(vector)) == approx(vector, abs=1e-7)
    assert between(np.eye(3), turn(vector), 0.5) == approx(turn(vector / 2), abs=1e-7)


def test_half_turns_have_an_axis() -> None:
    for axis in np.eye(3):
        assert np.abs(turn_vector(turn(np.pi * axis))) == approx(np.pi * axis, abs=1e-6)
