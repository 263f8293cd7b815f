"""The nearest point of a triangle against a fine lattice of its points."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.nearest import nearest_weights


@given(st.integers(0, 2**32 - 1))
def test_no_other_point_of_the_triangle_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners, point = rng.normal(0, 1, (3, 3)), rng.normal(0, 1, 3) * rng.choice([0.3, 3.0])
    sides = corners[1:] - corners[0]
    v, w = nearest_weights(*((point - corner) @ side for corner in corners for side in sides))
    assert v >= 0 and w >= 0 and v + w <= 1 + 1e-12
    steps = np.linspace(0, 1, 41)
    lattice = np.array([(s, t) for s in steps for t in steps if s + t <= 1 + 1e-12])
    others = np.linalg.norm(corners[0] + lattice @ sides - point, axis=1)
    assert np.linalg.norm(corners[0] + np.array([v, w]) @ sides - point) <= others.min() + 1e-12
