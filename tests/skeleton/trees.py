"""Small skeletons for tests."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton


def random_skeleton(rng: np.random.Generator, n_joints: int = 6) -> Skeleton:
    """A random tree: the root slides and turns, the others turn about 0 to 3 random axes."""
    parents = np.array([-1, *(int(rng.integers(0, j)) for j in range(1, n_joints))])
    turns = [3, *(int(rng.integers(0, 4)) for _ in range(1, n_joints))]
    joints = [0, 0, 0, *(j for j in range(n_joints) for _ in range(turns[j]))]
    axes = rng.normal(size=(len(joints), 3))
    return Skeleton(
        tuple(f"joint{j}" for j in range(n_joints)),
        parents,
        rng.normal(size=(n_joints, 3)),
        np.array(joints),
        axes / np.linalg.norm(axes, axis=1, keepdims=True),
        np.arange(len(joints)) < 3,
        np.tile([-np.inf, np.inf], (len(joints), 1)),
        tuple(f"joint{j}.{d}" for d, j in enumerate(joints)),
    )


def planar_arm(lengths: FloatArray) -> Skeleton:
    """Links along x that turn about z, one DOF each; the last joint is the tip and does not turn."""
    n = len(lengths)
    return Skeleton(
        tuple(f"joint{j}" for j in range(n + 1)),
        np.arange(-1, n),
        np.array([[0.0, 0.0, 0.0], *([length, 0.0, 0.0] for length in lengths)]),
        np.arange(n),
        np.tile([0.0, 0.0, 1.0], (n, 1)),
        np.zeros(n, np.bool_),
        np.tile([-np.pi, np.pi], (n, 1)),
        tuple(f"joint{j}.z" for j in range(n)),
    )
