"""Articulated bodies: a skeleton whose joints carry convex pieces, and the chains in which it gives way."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.avoidance.capsules import LEGS, RADII, UNKNOWN
from mhvedit.errors import ShapeError
from mhvedit.files import load_table
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.dofs import body_skeleton
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Skeleton, ancestors
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.tables import ROLES
from mhvedit.world.broad import colliders_of
from mhvedit.world.cones import ReachCone, load_cones
from mhvedit.world.materials import PACKAGE
from mhvedit.world.narrow import Narrow
from mhvedit.world.pieces import Piece, capsule
from mhvedit.world.problems import WorldError

ROOT_EFFORT: Final = 200.0  # per m2 or rad2: a tracked body stands where it is before its limbs do
NEIGHBOURS: Final = 2  # joints: limbs so near in the tree are not tested against each other
REST_GAP: Final = 0.005  # m: pieces nearer than this where q = 0 are not tested
_SHORT: Final = 1e-4  # m
_ARM: Final = ("clavicle", "upper_arm", "forearm", "hand")
_LEG: Final = ("thigh", "shin", "foot", "toe")


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A driven articulated body."""

    skeleton: Skeleton
    pieces: tuple[Piece, ...]  # P, in the frames of their joints
    joint: IntArray  # (P,) joint that carries each
    chain: IntArray  # (J,) chain of each joint; -1 for the trunk, which only moves as a whole
    self_pairs: BoolArray  # (P, P) symmetric: which pieces may meet
    effort: FloatArray  # (D,) how little each DOF likes to leave the tracked posture
    cones: tuple[ReachCone, ...]
    material: str  # of the table

    def __post_init__(self) -> None:
        n = len(self.pieces)
        for name, array, shape in (
            ("joint", self.joint, (n,)),
            ("chain", self.chain, (self.skeleton.n_joints,)),
            ("self_pairs", self.self_pairs, (n, n)),
            ("effort", self.effort, (self.skeleton.n_dofs,)),
        ):
            if array.shape != shape:
                raise ShapeError(name, array.shape, shape)


def inward_dofs(figure: Figure, joint: int) -> IntArray:
    """DOFs from a joint inwards to the root of its chain, the outermost first; none for the trunk."""
    skeleton, chain, joints = figure.skeleton, figure.chain[joint], list[int]()
    while joint >= 0 and chain >= 0 and figure.chain[joint] == chain:
        joints.append(joint)
        joint = int(skeleton.parents[joint])
    found = np.flatnonzero(np.isin(skeleton.dof_joint, joints) & ~skeleton.dof_slides)
    return np.asarray(found[::-1].copy())


def capsule_figure(skeleton: Skeleton, *, cones: bool = True) -> Figure:
    """A body of capsules, one for each bone, as wide as that limb usually is, in five chains (D1).

    Args:
        skeleton: z up where q = 0.
        cones: limit shoulders and hips by the package's reach cones where the skeleton has joints of those names.

    Raises:
        WorldError: no bone has a length.
    """
    at, roles = skeleton.rest_positions, joint_roles(skeleton.names)
    scale = max(float(np.ptp(at[:, 2])), 0.1) / (2 * LEGS)
    pieces, carriers = list[Piece](), list[int]()
    for child in range(1, skeleton.n_joints):
        joint, offset = int(skeleton.parents[child]), skeleton.offsets[child]
        length = float(np.linalg.norm(offset))
        if length >= _SHORT:
            radius = scale * RADII.get(_plain(roles[joint]), UNKNOWN)
            pieces.append(capsule(np.zeros(3), offset, min(radius, length / 2 + 0.01)))
            carriers.append(joint)
    if not pieces:
        raise WorldError("figure", "bones that have a length", "none")
    effort = np.array([ROLES[roles[j]].effort if roles[j] in ROLES else 1.0 for j in skeleton.dof_joint])
    effort[skeleton.dof_joint == 0] = ROOT_EFFORT
    joint_of = np.array(carriers)
    return Figure(
        skeleton,
        tuple(pieces),
        joint_of,
        _chains(skeleton, roles),
        _self_pairs(skeleton, tuple(pieces), joint_of),
        effort,
        load_cones(skeleton) if cones else (),
        "human",
    )


def load_avatar() -> Figure:
    """The package's avatar, 1.75 m tall: arms out sideways and looking to -y where q = 0."""
    table = load_table(PACKAGE, "avatar")
    rows: list[tuple[str, str, list[float]]] = [tuple(row) for row in table["joints"]]
    for name, up, offset in [row for row in rows if row[0].startswith("left_")]:
        mirrored = [-offset[0], *offset[1:]]
        rows.append((name.replace("left_", "right_"), up.replace("left_", "right_"), mirrored))
    names = tuple(name for name, *_ in rows)
    parents = np.array([names.index(up) if up else -1 for _, up, _ in rows])
    skeleton = body_skeleton(
        names,
        parents,
        np.array([offset for *_, offset in rows]),
        turning={name: None for name in names if not name.endswith("_end")},
        sliding=[names[0]],
    )
    return capsule_figure(skeleton)


def _plain(role: str) -> str:
    """A role without its side."""
    return role.removeprefix("left_").removeprefix("right_")


def _chains(skeleton: Skeleton, roles: tuple[str, ...]) -> IntArray:
    """(J,) neck, arms and legs; joints without a role are with the joint above them."""
    names = ["neck", "left_arm", "right_arm", "left_leg", "right_leg"]
    found = np.full(skeleton.n_joints, -1)
    for joint, role in enumerate(roles):
        side, part = role.partition("_")[0], _plain(role)
        if role in ("neck", "head"):
            found[joint] = 0
        elif part in _ARM or part in _LEG:
            found[joint] = names.index(f"{side}_{'arm' if part in _ARM else 'leg'}")
        elif role == "" and joint:
            found[joint] = found[skeleton.parents[joint]]
    return found


def _self_pairs(skeleton: Skeleton, pieces: tuple[Piece, ...], joint: IntArray) -> BoolArray:
    """(P, P) pairs that are neither near in the tree nor near at rest."""
    above = ancestors(skeleton)
    depth = above.sum(1)
    common = np.where(above[:, None] & above[None], depth, 0).max(-1)
    steps = depth[:, None] + depth[None] - 2 * common
    far = steps[joint[:, None], joint[None]] > NEIGHBOURS
    rotations, positions = joint_frames(skeleton, np.zeros(skeleton.n_dofs))
    narrow = Narrow(colliders_of(pieces, joint, far))
    close = narrow.near(rotations, positions, reach=REST_GAP).pairs
    far[close[:, 0], close[:, 1]] = False
    far[close[:, 1], close[:, 0]] = False
    return np.asarray(far)
