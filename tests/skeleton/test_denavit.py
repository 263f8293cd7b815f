import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from mhvedit.collision.spheres import body_spheres
from mhvedit.errors import ShapeError
from mhvedit.skeleton.denavit import dh_chains, dh_frames, dh_skeleton, dh_transform
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.skin import read_skinned
from mhvedit.skeleton.views import five_chains, limb_joints, thesis_dofs
from tests.skeleton.shared_motions import shared_motion
from tests.skeleton.trees import planar_arm


def test_a_row_is_four_elementary_motions() -> None:
    """Equation 2.2: Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    theta, d, a, alpha = 0.3, 0.4, 0.5, 0.6
    about_z, about_x = np.eye(4), np.eye(4)
    about_z[:3, :3] = Rotation.from_euler("z", theta).as_matrix()
    about_x[:3, :3] = Rotation.from_euler("x", alpha).as_matrix()
    about_z[2, 3], about_x[0, 3] = d, a
    assert dh_transform(theta, d, a, alpha) == approx(about_z @ about_x)


def test_55_degrees_of_freedom_in_the_thesiss_order() -> None:
    """B1.1: 6 global, spine 12, arms 18, neck 5, legs 14."""
    names = dh_skeleton().dof_names
    parts = [name.split("_")[-1].split(".")[0] for name in names]
    assert len(names) == 55
    assert [n.split(".")[0] for n in names[:6]] == ["pelvis"] * 6
    assert all(n.startswith("spine") for n in names[6:18])
    assert all(part in ("clavicle", "arm", "forearm", "hand") for part in parts[18:36])
    assert all(n.startswith(("neck", "head")) for n in names[36:41])
    assert all(part in ("thigh", "shin", "foot", "toe") for part in parts[41:])


def test_the_skeleton_moves_as_the_products_of_the_rows_do() -> None:
    """Equation 2.1 against the tree's forward kinematics, every chain, at random postures."""
    skeleton, rng = dh_skeleton(), np.random.default_rng(0)
    for q in rng.uniform(-1, 1, (5, 55)):
        rotations, positions = joint_frames(skeleton, q)
        rest = skeleton.rest_positions
        for chain in dh_chains():
            dofs = [skeleton.dof_names.index(name) for name in chain.dofs]
            carrier = np.eye(4)
            if chain.after:
                joint = skeleton.names.index(chain.after)
                carrier[:3, :3] = rotations[joint]
                carrier[:3, 3] = positions[joint] - rotations[joint] @ rest[joint]
            frames = carrier @ chain.base @ dh_frames(chain, q[dofs])
            still = chain.base @ dh_frames(chain, np.zeros(len(dofs)))
            end = skeleton.names.index(chain.tip or chain.dofs[-1].split(".")[0])
            last = int(skeleton.dof_joint[dofs[-1]])
            assert frames[-1, :3, :3] == approx(rotations[last] @ still[-1, :3, :3], abs=1e-9)
            assert frames[-1, :3, 3] == approx(positions[end], abs=1e-9)


def test_left_and_right_are_mirror_images() -> None:
    skeleton = dh_skeleton()
    for name, place in zip(skeleton.names, skeleton.rest_positions, strict=True):
        if name.startswith("left"):
            other = skeleton.names.index(name.replace("left", "right"))
            assert skeleton.rest_positions[other] == approx(place * [-1, 1, 1])
    for name, limits in zip(skeleton.dof_names, skeleton.limits, strict=True):
        if name.startswith("left"):
            other = skeleton.limits[skeleton.dof_names.index(name.replace("left", "right"))]
            assert other == approx(limits if name.endswith("x") else -limits[::-1])


def test_one_tree_has_all_three_views() -> None:
    """D1."""
    body = read_skinned(shared_motion("walk_throw_normal")).body.skeleton
    assert len(limb_joints(body)) == 23
    chains = five_chains(body)
    assert sorted(np.concatenate(list(chains.values()))) == list(range(body.n_joints))
    assert {name: len(np.intersect1d(c, limb_joints(body))) for name, c in chains.items()} == {
        "torso": 7,
        "left_arm": 4,
        "right_arm": 4,
        "left_leg": 4,
        "right_leg": 4,
    }
    dofs = thesis_dofs(body)
    assert len(set(dofs.tolist())) == 55
    assert body.dof_names[dofs[-1]] == "LeftToeBase.x"
    thesis = dh_skeleton()
    assert thesis_dofs(thesis).tolist() == list(range(55))
    assert len(body_spheres(thesis).names) == 39
    with pytest.raises(ShapeError, match=r"expected all 55 DOFs of the thesis, found no pelvis\.tx"):
        thesis_dofs(planar_arm(np.ones(2)))
