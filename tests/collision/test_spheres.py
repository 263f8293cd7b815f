from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from mhvedit.collision.spheres import (
    GROUPS,
    active_groups,
    body_spheres,
    enforced_pairs,
    fitted_spheres,
    joined,
    sphere_contacts,
    sphere_depths,
    table_exclusions,
)
from mhvedit.errors import ShapeError
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.skin import read_skinned
from tests.skeleton.shared_motions import shared_motion
from tests.skeleton.trees import planar_arm


def test_39_spheres_in_5_groups_make_602_pairs() -> None:
    spheres = body_spheres(read_skinned(shared_motion("walk_throw_normal")).body.skeleton)
    assert len(spheres.names) == 39  # B3.1
    assert np.bincount(spheres.group).tolist() == [11, 7, 7, 7, 7]
    assert len(enforced_pairs(spheres, ())) == 602  # B3.2
    enforced = enforced_pairs(spheres, table_exclusions())
    assert len(enforced) == 602 - len(table_exclusions())
    assert (spheres.group[enforced[:, 0]] != spheres.group[enforced[:, 1]]).all()


@pytest.mark.parametrize("name", ["walk_throw_normal", "range_of_motion_f_normal"])
def test_nothing_that_is_enforced_intersects_at_rest(name: str) -> None:
    body = read_skinned(shared_motion(name)).body
    for spheres in (body_spheres(body.skeleton), fitted_spheres(body)):
        pairs = enforced_pairs(spheres, table_exclusions())
        assert sphere_depths(body.skeleton, spheres, pairs, np.zeros(body.skeleton.n_dofs)).max() < 0


def test_left_and_right_are_mirror_images() -> None:
    skeleton = read_skinned(shared_motion("walk_throw_normal")).body.skeleton
    spheres = body_spheres(skeleton)
    world = spheres.centre + skeleton.rest_positions[spheres.joint]
    for name, point, radius in zip(spheres.names, world, spheres.radius, strict=True):
        if name.startswith("left"):
            other = spheres.names.index(name.replace("left", "right"))
            assert world[other] == approx(point * [-1, 1, 1], abs=1e-5)
            assert spheres.radius[other] == approx(radius)


def test_spheres_meet_where_centres_are_nearer_than_the_radii_together() -> None:
    """B3.3, with the sign of the thesis's section 1.3.3."""
    motion = read_skinned(shared_motion("jump_crawl_heavy"))
    skeleton, q = motion.body.skeleton, motion.motion.q[::9]
    spheres = body_spheres(skeleton)
    pairs = enforced_pairs(spheres, table_exclusions())
    contacts = sphere_contacts(skeleton, spheres, pairs, q)
    assert len(contacts.frame) > 0
    found = set(zip(contacts.frame.tolist(), contacts.pair.tolist(), strict=True))
    for frame in np.unique(contacts.frame)[:3]:
        centres = points_on_joints(skeleton, q[frame], spheres.joint, spheres.centre)
        for p, (i, j) in enumerate(pairs):
            square = ((centres[i] - centres[j]) ** 2).sum()
            assert ((int(frame), p) in found) == (square < (spheres.radius[i] + spheres.radius[j]) ** 2)


def test_groups_whose_boxes_are_apart_have_no_contact() -> None:
    motion = read_skinned(shared_motion("jump_crawl_heavy"))
    skeleton = motion.body.skeleton
    spheres = body_spheres(skeleton)
    pairs = enforced_pairs(spheres, ())
    apart = 0
    for q in motion.motion.q[::81]:
        active = active_groups(skeleton, spheres, q)
        hit = sphere_depths(skeleton, spheres, pairs, q) > 0
        assert active[spheres.group[pairs[hit, 0]], spheres.group[pairs[hit, 1]]].all()
        apart += int((~active).sum() - len(GROUPS))
    assert apart > 0


def test_equipment_joins_behind_the_body() -> None:
    spheres = body_spheres(read_skinned(shared_motion("walk_throw_normal")).body.skeleton)
    both = joined(spheres, replace(spheres, names=tuple(f"copy_{n}" for n in spheres.names)))
    assert len(both.names) == 78
    assert both.names[:39] == spheres.names


def test_a_skeleton_without_the_joints_is_refused() -> None:
    with pytest.raises(ShapeError, match="no joint that is a neck"):
        body_spheres(planar_arm(np.ones(3)))
