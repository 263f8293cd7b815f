from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from mhvedit.collision.detect import CollisionBody, collision_body, surfaces_cross
from mhvedit.collision.limbs import limbs_of
from mhvedit.collision.pairs import all_pairs
from mhvedit.collision.reachable import (
    limb_balls,
    meeting_rates,
    often_meeting_pairs,
    random_postures,
    safely_reachable_pairs,
)
from mhvedit.errors import ShapeError
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.skin import posed_vertices, read_skinned
from tests.collision.bodies import boxes_on_sliders
from tests.skeleton.shared_motions import shared_motion


def _stiff(share: float) -> CollisionBody:
    """A body whose joints only go a share of their way; all 253 pairs."""
    body = read_skinned(shared_motion("walk_throw_normal")).body
    stiff = replace(body, skeleton=replace(body.skeleton, limits=body.skeleton.limits * share))
    return collision_body(stiff, pairs=all_pairs(limbs_of(stiff)))


@pytest.mark.parametrize("rigid", [False, True])
def test_the_safe_mode_prunes_and_loses_no_pair_that_meets(rigid: bool) -> None:
    body = _stiff(0.25)
    kept = {tuple(pair) for pair in safely_reachable_pairs(body, parts=200, rigid=rigid).limbs.tolist()}
    assert len(kept) < 253 - 40
    q = random_postures(body.body.skeleton, 300, np.random.default_rng(0))
    low, high = body.body.skeleton.limits[6:].T
    q[200:, 6:] = np.where(q[200:, 6:] < (low + high) / 2, low, high)  # and corners of the limits
    met = surfaces_cross(body, q, rigid=rigid).any(0)
    assert met.sum() > 20
    for pair in body.pairs.limbs[met].tolist():
        assert tuple(pair) in kept


def test_more_parts_prove_more() -> None:
    body = _stiff(0.25)
    few, many = (len(safely_reachable_pairs(body, parts=n, rigid=True).limbs) for n in (5, 200))
    assert many < few < 253


def test_balls_contain_the_skinned_limbs_in_every_posture() -> None:
    body = _stiff(0.5)
    balls, arrays, skeleton = limb_balls(body), body.limbs.arrays, body.body.skeleton
    normed = replace(body.body, weights=body.body.weights / body.body.weights.sum(1, keepdims=True))
    joints = np.repeat(arrays.joints, np.diff(balls.start))
    for q in random_postures(skeleton, 10, np.random.default_rng(1)):
        centres = points_on_joints(skeleton, q, joints, balls.centre - skeleton.rest_positions[joints])
        vertices = posed_vertices(normed, q)
        for limb in range(body.limbs.n_limbs):
            vertex = arrays.vertex[arrays.vertex_start[limb] : arrays.vertex_start[limb + 1]]
            own = vertices[vertex[vertex >= 0]]
            mine = slice(balls.start[limb], balls.start[limb + 1])
            gaps = np.linalg.norm(own[:, None] - centres[mine], axis=2) - balls.radius[mine]
            assert gaps.min(1).max() < 1e-9


def test_the_statistical_mode_keeps_what_meets_often_enough() -> None:
    body = _stiff(0.5)
    q = random_postures(body.body.skeleton, 400, np.random.default_rng(2))
    rates = meeting_rates(body, q)
    for rate in (1e-3, 0.1):
        assert often_meeting_pairs(body, q, rate=rate).limbs.tolist() == body.pairs.limbs[rates >= rate].tolist()
    assert rates[0] == approx(surfaces_cross(body, q, rigid=True)[:, 0].mean())


def test_random_postures_keep_to_the_limits_and_the_root_in_place() -> None:
    skeleton = _stiff(1.0).body.skeleton
    q = random_postures(skeleton, 50, np.random.default_rng(3))
    assert (q[:, :6] == 0).all()
    assert (q[:, 6:] >= skeleton.limits[6:, 0]).all()
    assert (q[:, 6:] <= skeleton.limits[6:, 1]).all()


def test_free_slides_have_no_safe_mode() -> None:
    body = collision_body(boxes_on_sliders(np.ones((2, 3)), np.array([[0.0, 0, 0], [3.0, 0, 0]])))
    with pytest.raises(ShapeError, match=r"everything that slides but the root, found none for box0\.tx"):
        safely_reachable_pairs(body)
