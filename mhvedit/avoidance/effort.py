"""What it costs to move each DOF away from the captured posture: gamma of Degenhardt's eq. 2.5."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.tables import ROLES

UNKNOWN = 5.0  # of joints that the tables do not know
SLIDE = 60.0  # 1/m^2: moving the whole body by 13 cm costs as much as turning an arm's joint by one radian


def effort_weights(skeleton: Skeleton) -> FloatArray:
    """(D,) gamma, 1/rad^2 and 1/m^2."""
    roles = joint_roles(skeleton.names)
    turning = np.array([ROLES[roles[j]].effort if roles[j] in ROLES else UNKNOWN for j in skeleton.dof_joint])
    return np.where(skeleton.dof_slides, SLIDE, turning)
