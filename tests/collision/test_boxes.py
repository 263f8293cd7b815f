import coal
import numpy as np
from scipy.spatial.transform import Rotation

from mhvedit.collision.boxes import LEAF, box_tree, boxes_overlap
from mhvedit.geometry.arrays import FloatArray


def test_overlap_is_coals_distance_being_zero() -> None:
    rng = np.random.default_rng(0)
    n = 2000
    centres, halves, turns = _boxes(rng, n)
    found = boxes_overlap(centres[0], halves[0], turns[0], centres[1], halves[1], turns[1])
    distance = np.array([_distance(centres[:, i], halves[:, i], turns[:, i]) for i in range(n)])
    assert 300 < found.sum() < n - 300
    clear = np.abs(distance) > 1e-6
    assert clear.sum() > n - 20
    assert (found[clear] == (distance[clear] <= 0)).all()


def test_parallel_boxes_that_touch_overlap_and_a_gap_separates() -> None:
    """Cross products of parallel edges are nothing but rounding: they must not separate (A4.1)."""
    rng = np.random.default_rng(1)
    turn = Rotation.random(500, rng=rng).as_matrix()
    half = rng.uniform(0.01, 1.0, (500, 3))
    for axis in range(3):
        for gap, expected in ((-1e-7, True), (1e-7, False)):
            offset = np.zeros((500, 3))
            offset[:, axis] = 2 * half[:, axis] + gap
            moved = (turn @ offset[..., None])[..., 0]
            turned = turn @ Rotation.from_euler("xyz", [np.pi / 2 * (axis == k) for k in range(3)]).as_matrix()
            other = half[:, [[0, 2, 1], [2, 1, 0], [1, 0, 2]][axis]]
            for t, h in ((turn, half), (turned, other)):
                assert (boxes_overlap(np.zeros((500, 3)), half, turn, moved, h, t) == expected).all()


def test_a_tree_holds_every_triangle_once_and_slabs_follow_the_bone() -> None:
    rng = np.random.default_rng(2)
    corners = rng.uniform(0, 1, (300, 1, 3)) * [0.30, 0.1, 0.1] + rng.normal(0, 0.001, (300, 3, 3))
    tree = box_tree(corners)
    assert sorted(tree.order) == list(range(300))
    assert tree.size[0] == 5  # 0.30 m in slabs of 60 mm (A3.5)
    leaves = tree.leaf
    assert tree.size[leaves].max() <= LEAF
    held = np.concatenate([np.arange(f, f + c) for f, c in zip(tree.first[leaves], tree.size[leaves], strict=True)])
    assert sorted(held) == list(range(300))
    children = np.concatenate(
        [np.arange(f, f + c) for f, c in zip(tree.first[~leaves], tree.size[~leaves], strict=True)]
    )
    assert sorted(children) == list(range(1, len(leaves)))


def test_few_triangles_are_one_box() -> None:
    tree = box_tree(np.zeros((3, 3, 3)))
    assert tree.leaf.tolist() == [True]


def _boxes(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, half widths and rotations of n pairs of boxes."""
    turns = Rotation.random(2 * n, rng=rng).as_matrix().reshape(2, n, 3, 3)
    return rng.uniform(-1, 1, (2, n, 3)), rng.uniform(0.05, 0.9, (2, n, 3)), turns


def _distance(centre: FloatArray, half: FloatArray, turn: FloatArray) -> float:
    """Signed distance of two boxes, by coal."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    a, b = (coal.CollisionObject(coal.Box(*(2 * half[k])), turn[k], centre[k]) for k in range(2))
    return float(coal.distance(a, b, request, result))
