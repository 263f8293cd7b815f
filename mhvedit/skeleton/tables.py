"""The tables of the human body that come with the package: what programs call its joints, limits, effort."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.files import load_table

PACKAGE: Final = "mhvedit.skeleton"
FREE: Final = (-np.inf, np.inf)
_MIRRORED: Final = {"x": 1.0, "y": -1.0, "z": -1.0}  # an angle seen in a mirror across x


@dataclass(frozen=True, slots=True)
class JointRole:
    """What the tables know about a joint of the body."""

    order: str  # axes in the order in which they turn, e.g. "zyx"
    limits: Mapping[str, tuple[float, float]]  # rad, by axis
    effort: float  # gamma of posture prediction
    shared: bool = False  # limits are those of all joints of this role together


def _roles() -> dict[str, JointRole]:
    """All roles; those of the right side are mirrored from the left."""
    roles = {}
    for name, row in load_table(PACKAGE, "body")["joints"].items():
        limits = {axis: _radians(row["limits"][axis]) if "limits" in row else FREE for axis in "xyz"}
        roles[name] = JointRole(row["order"], limits, row["effort"], row.get("shared", False))
        if name.startswith("left_"):
            mirrored = {axis: _turned(limits[axis], _MIRRORED[axis]) for axis in "xyz"}
            roles[name.replace("left_", "right_")] = JointRole(row["order"], mirrored, row["effort"])
    return roles


def _radians(degrees: tuple[float, float]) -> tuple[float, float]:
    """A range in rad."""
    low, high = degrees
    return float(np.radians(low)), float(np.radians(high))


def _turned(limits: tuple[float, float], sign: float) -> tuple[float, float]:
    """A range, or its mirror image."""
    return limits if sign > 0 else (-limits[1], -limits[0])


ROLES: Final[Mapping[str, JointRole]] = _roles()
JOINT_NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    name: tuple(others) for name, others in load_table(PACKAGE, "body")["names"].items()
}
