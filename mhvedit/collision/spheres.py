"""Spheres on limbs, in groups: the cheap test of self-avoidance (Degenhardt, 3.3.1; B3).

Two spheres intersect where their centres are nearer than the sum of their radii; the thesis prints the sign the
other way round in one place.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Final

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.skin import SkinnedBody

GROUPS: Final = ("torso", "left_arm", "right_arm", "left_leg", "right_leg")


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Spheres that move with joints."""

    names: tuple[str, ...]  # S
    joint: IntArray  # (S,)
    centre: FloatArray  # (S, 3) m, in the joint's frame
    radius: FloatArray  # (S,) m
    group: IntArray  # (S,) index into GROUPS

    def __post_init__(self) -> None:
        n = len(self.names)
        for name, array, shape in (
            ("joint", self.joint, (n,)),
            ("centre", self.centre, (n, 3)),
            ("radius", self.radius, (n,)),
            ("group", self.group, (n,)),
        ):
            if array.shape != shape:
                raise ShapeError(name, array.shape, shape)
        if not (self.radius > 0).all():
            raise ShapeError("radius", self.radius.min(), "more than 0")


@dataclass(frozen=True, slots=True, eq=False)
class SphereContacts:
    """Pairs of spheres that intersect, frame by frame (B3.5)."""

    frame: IntArray  # (K,) ascending
    pair: IntArray  # (K,) index into the pairs
    depth: FloatArray  # (K,) m


def body_spheres(skeleton: Skeleton) -> Spheres:
    """The 39 spheres of the table on a skeleton, scaled to its stature (B3.1).

    Raises:
        ShapeError: the skeleton lacks a joint that the table needs.
    """
    table = sphere_table()
    roles, rest = joint_roles(skeleton.names), skeleton.rest_positions
    scale = _neck_height(rest, roles) / table["neck_height"]
    rows = [(group, row) for group in GROUPS for row in table["groups"][group]]
    ends = [_way(skeleton, roles, row["from"], row["to"]) for _, row in rows]
    joints, centres = [], []
    for (_, row), way in zip(rows, ends, strict=True):
        joint, point = _point_on_way(rest, way, row["along"])
        point = point + scale * np.array([row.get("aside", 0.0), -row.get("ahead", 0.0), 0.0])
        joints.append(joint)
        centres.append(point - rest[joint])
    return Spheres(
        tuple(row["name"] for _, row in rows),
        np.array(joints, np.int64),
        np.array(centres),
        scale * np.array([row["radius"] for _, row in rows]),
        np.array([GROUPS.index(group) for group, _ in rows], np.int64),
    )


def fitted_spheres(body: SkinnedBody) -> Spheres:
    """The 39 spheres with the radii of a body's own skin.

    Each vertex goes to the nearest sphere of its group (that of the nearest joint above it that has one); a sphere
    reaches as far as the nearer quarter of its vertices, and so lies within the skin of a limb that is not round. One
    without vertices keeps the radius of the table.
    """
    spheres = body_spheres(body.skeleton)
    centres = spheres.centre + body.skeleton.rest_positions[spheres.joint]
    group = _joint_groups(body.skeleton, spheres)[body.weights.argmax(1)]
    far = np.linalg.norm(body.vertices[:, None] - centres, axis=2)
    far[group[:, None] != spheres.group] = np.inf
    nearest, radius = far.argmin(1), spheres.radius.copy()
    for sphere in np.unique(nearest):
        radius[sphere] = np.percentile(far[nearest == sphere, sphere], 25)
    return Spheres(spheres.names, spheres.joint, spheres.centre, radius, spheres.group)


def _joint_groups(skeleton: Skeleton, spheres: Spheres) -> IntArray:
    """(J,) the group of each joint's spheres; of a joint without, that of its parent."""
    groups = np.zeros(skeleton.n_joints, np.int64)
    for joint in range(skeleton.n_joints):
        own = spheres.group[spheres.joint == joint]
        groups[joint] = own[0] if len(own) else groups[max(skeleton.parents[joint], 0)]
    return groups


def joined(spheres: Spheres, others: Spheres) -> Spheres:
    """Both, the others behind: equipment on a body (B4.1)."""
    return Spheres(
        spheres.names + others.names,
        np.concatenate([spheres.joint, others.joint]),
        np.concatenate([spheres.centre, others.centre]),
        np.concatenate([spheres.radius, others.radius]),
        np.concatenate([spheres.group, others.group]),
    )


def enforced_pairs(spheres: Spheres, exclusions: Sequence[tuple[str, str]]) -> IntArray:
    """(P, 2) every pair of spheres of different groups but those excluded (B3.2).

    Args:
        spheres: of all groups.
        exclusions: pairs of names, either way round; names that there are not do no harm.
    """
    first, second = np.triu_indices(len(spheres.names), 1)
    excluded = {frozenset(pair) for pair in exclusions}
    kept = [
        spheres.group[i] != spheres.group[j] and frozenset((spheres.names[i], spheres.names[j])) not in excluded
        for i, j in zip(first, second, strict=True)
    ]
    return np.stack([first, second], 1)[np.array(kept, np.bool_)]


def table_exclusions() -> tuple[tuple[str, str], ...]:
    """The pairs of names that the table excludes, both sides."""
    pairs = [(a, b) for a, b in sphere_table()["exclusions"]["pairs"]]
    both = [*pairs, *((_mirrored(a), _mirrored(b)) for a, b in pairs)]
    return tuple(dict.fromkeys((min(pair), max(pair)) for pair in both))


def sphere_depths(skeleton: Skeleton, spheres: Spheres, pairs: IntArray, q: FloatArray) -> FloatArray:
    """How far spheres reach into each other.

    Args:
        skeleton: that carries them.
        spheres: on its joints.
        pairs: (P, 2).
        q: (..., D) rad or m.

    Returns:
        (..., P) m, r1 + r2 - distance; negative is a gap.
    """
    centres = points_on_joints(skeleton, q, spheres.joint, spheres.centre)
    apart = np.linalg.norm(centres[..., pairs[:, 0], :] - centres[..., pairs[:, 1], :], axis=-1)
    return np.asarray(spheres.radius[pairs].sum(1) - apart)


def sphere_contacts(skeleton: Skeleton, spheres: Spheres, pairs: IntArray, q: FloatArray) -> SphereContacts:
    """Which pairs intersect in each posture of (T, D); arguments as in `sphere_depths`."""
    depths = sphere_depths(skeleton, spheres, pairs, q)
    frame, pair = np.nonzero(depths > 0)
    return SphereContacts(frame, pair, depths[frame, pair])


def active_groups(skeleton: Skeleton, spheres: Spheres, q: FloatArray) -> BoolArray:
    """Which groups have overlapping bounding boxes: the all-pairs table of O'Sullivan and Dingliana (B4.4).

    Args:
        skeleton: that carries the spheres.
        spheres: on its joints.
        q: (D,) rad or m.

    Returns:
        (G, G) symmetric, False on the diagonal: only spheres of these need a test.
    """
    centres = points_on_joints(skeleton, q, spheres.joint, spheres.centre)
    low, high = np.full((len(GROUPS), 3), np.inf), np.full((len(GROUPS), 3), -np.inf)
    np.minimum.at(low, spheres.group, centres - spheres.radius[:, None])
    np.maximum.at(high, spheres.group, centres + spheres.radius[:, None])
    overlap = ((low[:, None] <= high) & (low <= high[:, None])).all(2)
    return np.asarray(overlap & ~np.eye(len(GROUPS), dtype=np.bool_))


def sphere_table() -> dict[str, Any]:
    """The table of the package, with the right side."""
    table = tomllib.loads((files("mhvedit.collision") / "data" / "spheres.toml").read_text("utf-8"))
    for group in ("left_arm", "left_leg"):
        table["groups"][_mirrored(group)] = [
            {**row, **{key: _mirrored(row[key]) for key in ("name", "from", "to")}, "aside": -row.get("aside", 0.0)}
            for row in table["groups"][group]
        ]
    return table


_LEFT_RIGHT: Final = {"left": "right", "right": "left"}


def _neck_height(rest: FloatArray, roles: tuple[str, ...]) -> float:
    """From the lowest joint to the neck at rest, m."""
    if "neck" not in roles:
        raise ShapeError("skeleton", "no joint that is a neck", "all joints that the table of spheres names")
    return float(rest[roles.index("neck"), 2] - rest[:, 2].min())


def _mirrored(name: str) -> str:
    """The name of the other side."""
    return "_".join(_LEFT_RIGHT.get(word, word) for word in name.split("_"))


def _way(skeleton: Skeleton, roles: tuple[str, ...], start: str, end: str) -> list[int]:
    """Joints from one role to another, or to the tip of the longest bone below."""
    missing = [role for role in (start, end) if role not in roles and role != "tip"]
    if missing:
        raise ShapeError("skeleton", f"no joint that is a {missing[0]}", "all joints that the table of spheres names")
    first = roles.index(start)
    if end != "tip":
        way = [roles.index(end)]
        while way[-1] != first and way[-1] >= 0:
            way.append(int(skeleton.parents[way[-1]]))
        return way[::-1]
    way = [first]
    while (children := np.flatnonzero(skeleton.parents == way[-1])).size:
        way.append(int(children[np.argmax(np.linalg.norm(skeleton.offsets[children], axis=1))]))
    return way


def _point_on_way(rest: FloatArray, way: list[int], along: float) -> tuple[int, FloatArray]:
    """The joint that carries a point on a chain of bones, and where the point is at rest, (3,) m."""
    lengths = np.linalg.norm(np.diff(rest[way], axis=0), axis=1)
    left = along * float(lengths.sum())
    for i, length in enumerate(lengths):
        if left <= length or i == len(lengths) - 1:
            share = left / length if length > 0 else 0.0
            return way[i], rest[way[i]] + share * (rest[way[i + 1]] - rest[way[i]])
        left -= length
    return way[0], rest[way[0]]
