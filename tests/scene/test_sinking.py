"""How deep closed meshes are in each other: closed forms, and the slower `clearance` as an oracle."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.planar import apply_pose
from mhvedit.scene import sinking
from mhvedit.scene.sinking import sunk
from mhvedit.scene.surfaces import clearance, open_surface
from mhvedit.sequences.meshes import Mesh, joined

Shift = tuple[float, float, float]


def ball(radius: float, shift: Shift = (0, 0, 0)) -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return Mesh(np.asarray(shape.vertices, np.float64) + shift, np.asarray(shape.faces, np.int32))


def box(size: Shift, shift: Shift = (0, 0, 0)) -> Mesh:
    shape = trimesh.creation.box(extents=size)
    return Mesh(np.asarray(shape.vertices, np.float64) + shift, np.asarray(shape.faces, np.int32))


def by_clearance(a: Mesh, b: Mesh) -> float:
    return clearance(open_surface(a), open_surface(b), reach=0.01).depth


@pytest.mark.parametrize(("apart", "depth"), [(0.25, 0.0), (0.2001, 0.0), (0.19, 0.01), (0.12, 0.08)])
def test_two_balls(apart: float, depth: float) -> None:
    assert sunk(ball(0.1), ball(0.1, (apart, 0, 0))) == pytest.approx(depth, abs=2e-3)


def test_two_boxes_whose_corners_lie_on_lines_of_the_other() -> None:
    assert sunk(box((0.2, 0.2, 0.2)), box((0.2, 0.2, 0.2), (0.17, 0, 0))) == pytest.approx(0.03, abs=1e-6)


def test_one_in_the_other_is_as_deep_as_its_deepest_corner() -> None:
    assert sunk(box((1, 1, 1)), box((0.2, 0.2, 0.2), (0.1, 0, 0))) == pytest.approx(0.5, abs=1e-3)


def test_blades_that_cross_with_no_corner_inside() -> None:
    one, other = box((0.05, 0.004, 0.05)), box((0.004, 0.05, 0.03), (0.001, 0.0, 0.0))
    assert sunk(one, other) == pytest.approx(by_clearance(one, other), abs=1e-6)
    assert sunk(one, other) > 0.001


def test_what_runs_through_itself_is_solid_all_through() -> None:
    hand = joined([ball(0.1), box((0.05, 0.05, 0.4))])
    tip = box((0.01, 0.01, 0.2), (0.003, 0.002, 0.1))
    assert sunk(hand, tip) == pytest.approx(by_clearance(hand, tip), abs=1e-6)


def test_turned_inside_out_is_the_same_solid() -> None:
    a, b = ball(0.1), ball(0.1, (0.15, 0.01, 0.02))
    assert sunk(Mesh(a.vertices, a.faces[:, ::-1]), b) == pytest.approx(sunk(a, b), abs=1e-12)


def test_a_mesh_with_a_hole_is_left_to_the_other_way() -> None:
    a, b = ball(0.1), ball(0.1, (0.15, 0, 0))
    torn = Mesh(a.vertices, a.faces[5:])
    assert sunk(torn, b) == by_clearance(torn, b)


def test_vertices_of_no_face_count_for_nothing() -> None:
    a, b = ball(0.1), ball(0.1, (0.3, 0, 0))
    assert sunk(Mesh(np.vstack([a.vertices, [[0.3, 0, 0]]]), a.faces), b) == 0.0


@settings(deadline=None, max_examples=40)
@given(
    at=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    yaw=st.floats(-3, 3),
    size=st.floats(0.05, 0.4),
)
def test_it_is_the_depth_of_the_clearance(at: Shift, yaw: float, size: float) -> None:
    one = joined([ball(0.15), box((0.03, 0.5, 0.02), (0.1, 0.2, 0.05))])
    plain = box((size, 0.1, 0.25))
    turned = apply_pose(np.array([0.0, 0.0, yaw]), plain.vertices)
    other = Mesh(turned + np.array(at), plain.faces)
    found, expected = sunk(one, other), by_clearance(one, other)
    assert found == pytest.approx(expected, abs=2e-6)
    assert sunk(other, one) == pytest.approx(found, abs=1e-12)


def test_the_squares_of_the_plan_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = ball(0.1), ball(0.1, (0.15, 0.02, 0.03))
    fine = sunk(a, b)
    monkeypatch.setattr(sinking, "CELL", 0.3)
    assert sunk(a, b) == fine
