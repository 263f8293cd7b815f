from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from mhvedit.collision.detect import (
    collision_body,
    collisions,
    contacts_from,
    detect_motion,
    detect_posture,
    measure_depths,
    surfaces_cross,
    triangle_contacts,
)
from mhvedit.collision.limbs import cap_faces, limb_index, limbs_of
from mhvedit.collision.pairs import LimbPairs, all_pairs, non_adjacent_pairs
from mhvedit.collision.triangles import triangles_meet
from mhvedit.errors import ShapeError
from mhvedit.geometry.winding import winding_numbers
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import posed_vertices, read_skinned
from tests.collision import independent
from tests.collision.bodies import boxes_on_sliders
from tests.skeleton.shared_motions import shared_motion

CUBES = boxes_on_sliders(np.array([[0.2, 0.2, 0.2], [0.1, 0.1, 0.1]]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))


def test_the_depth_of_a_cube_in_a_cube_is_how_far_its_corners_went_in() -> None:
    body = collision_body(CUBES)
    q = np.zeros((4, 12))
    q[:, 6] = [-0.84, -0.86, -0.87, -0.99]  # the small one's face at x = 0.11, 0.09, 0.08, then around the middle
    contacts = detect_motion(body, Motion(q, 30.0))
    assert contacts.frame.tolist() == [1, 2, 3]
    assert contacts.depth == approx(np.array([0.01, 0.02, 0.05]))
    assert contacts.normal[:2] == approx(np.tile([-1.0, 0.0, 0.0], (2, 1)))
    assert collisions(contacts, tolerance=0.015).frame.tolist() == [2, 3]


def test_moving_along_the_normal_by_the_depth_separates() -> None:
    rng = np.random.default_rng(0)
    body = collision_body(CUBES)
    q = np.zeros((200, 12))
    q[:, 3:6], q[:, 9:12] = rng.uniform(-3, 3, (2, 200, 3))
    q[:, 6:9] = rng.uniform(-0.14, 0.14, (200, 3)) - [1.0, 0.0, 0.0]
    depths = measure_depths(body, q)
    assert 50 < (depths.depth > 0).sum()
    shallow = (depths.depth[:, 0] > 0) & (depths.depth[:, 0] < 0.02)
    moved = q[shallow].copy()
    moved[:, :3] += (depths.depth[shallow, :] + 1e-6) * depths.normal[shallow, 0]
    after = measure_depths(body, moved).depth[:, 0]
    assert (after < depths.depth[shallow, 0]).mean() > 0.9  # another corner may have become the deepest


def test_a_limb_wholly_inside_another_is_found_though_no_surfaces_cross() -> None:
    body = collision_body(CUBES)
    q = np.zeros(12)
    q[6] = -1.0
    contacts = detect_posture(body, q)
    assert not surfaces_cross(body, q[None]).any()
    assert contacts.depth == approx(np.array([0.05]))


def test_surfaces_that_cross_without_a_vertex_inside_are_a_contact_of_no_depth() -> None:
    """Two bars laid across each other."""
    bars = boxes_on_sliders(np.array([[1.0, 0.1, 0.1], [0.1, 1.0, 0.1]]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    q = np.zeros(12)
    q[8] = -0.95
    body = collision_body(bars)
    contacts = detect_posture(body, q)
    assert contacts.depth.tolist() == [0.0]
    assert contacts.vertex.tolist() == [-1]
    assert np.linalg.norm(contacts.normal[0]) == approx(1.0)
    assert np.abs(contacts.point[0, :2]).max() <= 0.05 + 1e-9
    triangles = triangle_contacts(body, q, 0)
    assert len(triangles.faces) > 0
    assert np.abs(triangles.segments[..., :2]).max() <= 0.05 + 1e-9
    assert (triangles.faces[:, 0] < 12).all()
    assert (triangles.faces[:, 1] >= 12).all()


def test_the_result_does_not_depend_on_the_number_of_threads() -> None:
    skinned = read_skinned(shared_motion("walk_throw_heavy"))
    body, q = collision_body(skinned.body), skinned.motion.q[:40]
    one, two = measure_depths(body, q, workers=1), measure_depths(body, q, workers=3)
    for field in ("crossing", "depth", "vertex", "first_inside", "point", "normal"):
        assert np.array_equal(getattr(one, field), getattr(two, field), equal_nan=field in ("point", "normal"))


def test_a_body_of_23_limbs_has_253_pairs_and_231_that_are_not_adjacent() -> None:
    limbs = limbs_of(read_skinned(shared_motion("walk_throw_normal")).body)
    assert limbs.n_limbs == 23
    assert len(all_pairs(limbs).limbs) == 253  # A4.4
    assert len(non_adjacent_pairs(limbs).limbs) == 231
    with pytest.raises(ShapeError, match=r"limb: expected one of Hips, .*, found 'Tail'"):
        limb_index(limbs, "Tail")


def test_bones_are_the_first_axes_and_the_pelvis_lies_across() -> None:
    limbs = limbs_of(read_skinned(shared_motion("walk_throw_normal")).body)
    for name, axis in (("LeftArm", [1, 0, 0]), ("RightLeg", [0, 0, -1]), ("Hips", [1, 0, 0]), ("Spine3", [1, 0, 0])):
        axes = limbs.arrays.axes[limb_index(limbs, name)]
        assert axes[:, 0] == approx(np.array(axis, float), abs=1e-6)  # A3.2, A3.4
        assert axes.T @ axes == approx(np.eye(3), abs=1e-12)


def test_capped_limbs_are_closed() -> None:
    cut = limbs_of(read_skinned(shared_motion("jump_crawl_heavy")).body)
    limbs, rng = cut.arrays, np.random.default_rng(0)
    for limb in range(cut.n_limbs):
        faces = limbs.faces[limbs.face_start[limb] : limbs.face_start[limb + 1]]
        caps = limbs.caps[limbs.cap_start[limb] : limbs.cap_start[limb + 1]]
        mine = cut.local[limbs.vertex_start[limb] : limbs.vertex_start[limb + 1]]
        points = rng.uniform(mine.min(0), mine.max(0), (30, 3))
        turns = winding_numbers(cut.local, np.concatenate([faces, caps]).astype(np.int32), points)
        assert turns == approx(np.round(turns), abs=1e-9)


def test_holes_that_touch_in_a_corner_are_closed_one_by_one() -> None:
    """Two triangles with one corner in common have two holes, not one with its middle between them."""
    rings, caps = cap_faces(np.array([[0, 1, 2], [0, 3, 4]]), 5)
    assert sorted(sorted(ring.tolist()) for ring in rings) == [[0, 1, 2], [0, 3, 4]]
    assert sorted(caps[:, 2].tolist()) == [5, 5, 5, 6, 6, 6]
    directed = {(int(a), int(b)) for a, b, _ in caps}
    assert directed == {(1, 0), (2, 1), (0, 2), (3, 0), (4, 3), (0, 4)}


@pytest.mark.parametrize(
    ("name", "first", "step"),
    [("walk_throw_normal", 60, 160), ("jump_crawl_heavy", 60, 160), ("walk_throw_heavy", 332, 300)],
)
def test_depths_agree_with_the_independent_judge(name: str, first: int, step: int) -> None:
    skinned = read_skinned(shared_motion(name))
    pieces, body = independent.cut(skinned.stored), collision_body(skinned.body)
    order = [pieces.pairs.index((int(a), int(b))) for a, b in body.pairs.limbs]
    frames = np.arange(first, skinned.motion.n_frames, step)
    ours = measure_depths(body, skinned.motion.q[frames]).depth
    judged = np.array([independent.depths(pieces, independent.posed(skinned.stored, int(f))) for f in frames])[:, order]
    assert (ours > 0).any()
    assert ours == approx(judged, abs=1e-4)
    assert body.rest_depth == approx(independent.rest_depths(skinned.stored, pieces)[order], abs=1e-4)


def test_rigid_limbs_and_skinned_ones_agree_at_rest() -> None:
    skinned = read_skinned(shared_motion("walk_throw_normal")).body
    body = collision_body(replace(skinned, weights=skinned.weights / skinned.weights.sum(1, keepdims=True)))
    q = np.zeros((1, skinned.skeleton.n_dofs))
    assert (surfaces_cross(body, q) == surfaces_cross(body, q, rigid=True)).all()
    assert measure_depths(body, q).depth == approx(measure_depths(body, q, rigid=True).depth, abs=1e-9)


def test_crossing_limbs_are_those_that_a_brute_force_search_finds() -> None:
    """All triangles against all, by trimesh's bounding boxes and our exact test."""
    skinned = read_skinned(shared_motion("jump_crawl_heavy"))
    body, q = collision_body(skinned.body), skinned.motion.q[403]
    vertices, arrays = posed_vertices(skinned.body, q), body.limbs.arrays
    crossing = surfaces_cross(body, q[None])[0]
    for pair in (*np.flatnonzero(crossing)[:4], *np.flatnonzero(~crossing)[::40]):
        a, b = (
            arrays.vertex[arrays.faces[arrays.face_start[x] : arrays.face_start[x + 1]]] for x in body.pairs.limbs[pair]
        )
        i, j = (k.ravel() for k in np.meshgrid(np.arange(len(a)), np.arange(len(b)), indexing="ij"))
        apart = (vertices[a].max(1)[i] < vertices[b].min(1)[j]) | (vertices[a].min(1)[i] > vertices[b].max(1)[j])
        i, j = i[~apart.any(1)], j[~apart.any(1)]
        i, j = (k[~(a[i][:, :, None] == b[j][:, None, :]).any((1, 2))] for k in (i, j))
        expected = {(x, y) for x, y in zip(i, j, strict=True) if triangles_meet(vertices[a[x]], vertices[b[y]])}
        assert crossing[pair] == bool(expected)
        assert len(triangle_contacts(body, q, int(pair)).faces) == len(expected)


def test_pairs_that_cannot_be_are_refused() -> None:
    with pytest.raises(ShapeError, match="the lower index first"):
        LimbPairs(np.array([[1, 0]]))
    with pytest.raises(ShapeError, match="limbs 0 to 1"):
        collision_body(CUBES, pairs=LimbPairs(np.array([[0, 2]])))


def test_contacts_are_sorted_by_frame_and_pair() -> None:
    skinned = read_skinned(shared_motion("jump_crawl_heavy"))
    body = collision_body(skinned.body)
    contacts = contacts_from(body, measure_depths(body, skinned.motion.q[400:420]))
    keys = contacts.frame * len(body.pairs.limbs) + contacts.pair
    assert (np.diff(keys) > 0).all()
    assert contacts.excess == approx(contacts.depth - body.rest_depth[contacts.pair])
