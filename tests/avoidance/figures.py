"""A plain figure of 55 DOFs with spheres on it, for tests of avoidance."""

import numpy as np

from mhvedit.avoidance.constraints import SphereGaps
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton

ARM = (("clavicle", (0.03, 0.0, 0.05), 2), ("upper_arm", (0.15, 0.0, 0.0), 3))
BELOW = (("forearm", (0.0, 0.0, -0.28), 2), ("hand", (0.0, 0.0, -0.25), 2))
LEG = (("thigh", (0.09, 0.0, -0.05), 3), ("shin", (0.0, 0.0, -0.43), 1), ("foot", (0.0, 0.0, -0.42), 2))
TOE = ("toe", (0.0, -0.12, -0.05), 1)


def figure() -> Skeleton:
    """Six global DOFs, spine 12, arms 2 x 9, neck 5, legs 2 x 7: arms hang down where q = 0."""
    rows = [("hips", "", (0.0, 0.0, 1.0), 6)]
    above = "hips"
    for i in range(4):
        rows.append((f"spine{i}", above, (0.0, 0.0, 0.12), 3))
        above = f"spine{i}"
    for side, sign in (("left", 1.0), ("right", -1.0)):
        up = above
        for name, (x, y, z), n in ARM + BELOW:
            rows.append((f"{side}_{name}", up, (sign * x, y, z), n))
            up = f"{side}_{name}"
    rows += [("neck", above, (0.0, 0.0, 0.12), 3), ("head", "neck", (0.0, 0.0, 0.1), 2)]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        up = "hips"
        for name, (x, y, z), n in (*LEG, TOE):
            rows.append((f"{side}_{name}", up, (sign * x, y, z), n))
            up = f"{side}_{name}"
    names = tuple(name for name, *_ in rows)
    dofs = [(joint, axis, n == 6 and axis < 3) for joint, (*_, n) in enumerate(rows) for axis in range(n)]
    joints = np.array([joint for joint, *_ in dofs])
    return Skeleton(
        names,
        np.array([names.index(up) if up else -1 for _, up, *_ in rows]),
        np.array([offset for _, _, offset, _ in rows]),
        joints,
        np.array([np.eye(3)[axis % 3] for _, axis, _ in dofs]),
        np.array([slides for *_, slides in dofs]),
        np.where(joints[:, None] == 0, [[-np.inf, np.inf]], [[-2.5, 2.5]]),
        tuple(f"{names[joint]}.{axis}" for joint, axis, _ in dofs),
    )


def spheres(skeleton: Skeleton, *, margin: float = 0.0) -> SphereGaps:
    """43 spheres in five groups, and all pairs of different groups."""
    rows: list[tuple[int, FloatArray, float, int]] = []

    def chain(joint: str, first: tuple[float, ...], last: tuple[float, ...], n: int, radius: float, group: int) -> None:
        for share in np.linspace(0.0, 1.0, n):
            at = (1 - share) * np.array(first) + share * np.array(last)
            rows.append((skeleton.names.index(joint), at, radius, group))

    for joint in ("hips", "spine0", "spine1", "spine2", "spine3"):
        chain(joint, (-0.07, 0.0, 0.05), (0.07, 0.0, 0.05), 2, 0.11, 0)
    chain("head", (0.0, 0.0, 0.1), (0.0, 0.0, 0.1), 1, 0.1, 0)
    for group, side in enumerate(("left", "right"), 1):
        chain(f"{side}_upper_arm", (0.0, 0.0, -0.14), (0.0, 0.0, -0.24), 2, 0.05, group)
        chain(f"{side}_forearm", (0.0, 0.0, -0.03), (0.0, 0.0, -0.2), 4, 0.045, group)
        chain(f"{side}_hand", (0.0, 0.0, -0.05), (0.0, 0.0, -0.12), 2, 0.045, group)
        chain(f"{side}_thigh", (0.0, 0.0, -0.12), (0.0, 0.0, -0.38), 3, 0.075, group + 2)
        chain(f"{side}_shin", (0.0, 0.0, -0.05), (0.0, 0.0, -0.35), 4, 0.055, group + 2)
        chain(f"{side}_foot", (0.0, -0.05, -0.05), (0.0, -0.05, -0.05), 1, 0.05, group + 2)
    groups = np.array([group for *_, group in rows])
    first, second = np.nonzero(np.triu(groups[:, None] != groups[None], 1))
    return SphereGaps(
        np.array([joint for joint, *_ in rows]),
        np.array([at for _, at, *_ in rows]),
        np.array([radius for _, _, radius, _ in rows]),
        np.stack([first, second], 1),
        margin=margin,
    )


def crossed_arms(skeleton: Skeleton, n: int, *, seed: int = 0) -> FloatArray:
    """(n, D) postures in which arms are likely to be in the trunk."""
    rng = np.random.default_rng(seed)
    q = np.zeros((n, skeleton.n_dofs))
    q[:, 6:] = rng.normal(0.0, 0.15, (n, skeleton.n_dofs - 6))
    for side in ("left", "right"):
        arm = np.flatnonzero(skeleton.dof_joint == skeleton.names.index(f"{side}_upper_arm"))
        q[:, arm] += rng.normal(0.0, 0.4, (n, 3))
        q[:, np.flatnonzero(skeleton.dof_joint == skeleton.names.index(f"{side}_forearm"))[0]] -= rng.uniform(0, 1.4, n)
    return q
