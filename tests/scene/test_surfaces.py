"""Depth and gap of solids that have closed forms, of meshes with holes and flipped faces, of blades that only cross."""

import builtins
import subprocess
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

from mhvedit.errors import MissingLibrary
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.scene.surfaces import clearance, is_inside, load_open3d, open_surface, points_of_large_faces
from mhvedit.sequences.meshes import Mesh


def mesh(shape: trimesh.Trimesh, shift: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    return Mesh(np.asarray(shape.vertices, np.float64) + shift, np.asarray(shape.faces, np.int32))


def ball(radius: float, shift: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    return mesh(trimesh.creation.icosphere(subdivisions=4, radius=radius), shift)


def box(size: tuple[float, float, float], shift: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    return mesh(trimesh.creation.box(extents=size), shift)


def keeping(whole: Mesh, kept: BoolArray) -> Mesh:
    return Mesh(whole.vertices, whole.faces[kept])


def gap(a: Mesh, b: Mesh, reach: float = 0.5) -> float:
    return clearance(open_surface(a), open_surface(b), reach=reach).gap


@pytest.mark.parametrize("apart", [0.25, 0.205, 0.19, 0.15])
def test_two_balls(apart: float) -> None:
    found = gap(ball(0.1), ball(0.1, (apart, 0, 0)))
    assert found == pytest.approx(apart - 0.2, abs=1e-3)


@pytest.mark.parametrize("shift", [0.3, 0.22, 0.18])
def test_two_boxes_of_twelve_faces(shift: float) -> None:
    found = gap(box((0.2, 0.2, 0.2)), box((0.2, 0.14, 0.14), (shift, 0.01, 0.02)))
    assert found == pytest.approx(shift - 0.2, abs=1e-6)


def test_a_wall_that_a_body_stands_in_is_measured_between_its_corners() -> None:
    wall, body = box((0.02, 4.0, 4.0)), ball(0.2, (0.15, 0.4, 0.3))
    assert gap(wall, body) == pytest.approx(-0.06, abs=2e-3)


def test_what_is_out_of_reach_is_infinitely_far() -> None:
    found = clearance(open_surface(ball(0.1)), open_surface(ball(0.1, (1.0, 0, 0))), reach=0.5)
    assert found.gap == np.inf and found.depth == 0 and np.isnan(found.point).all() and not found.crossing


def test_one_inside_the_other_is_as_deep_as_the_innermost_point() -> None:
    found = clearance(open_surface(ball(0.3)), open_surface(ball(0.1)), reach=0.5)
    assert found.depth == pytest.approx(0.2, abs=2e-3)
    assert found.crossing


def test_blades_that_cross_without_a_vertex_inside() -> None:
    flat, upright = box((1.0, 0.06, 0.006)), box((0.06, 1.0, 0.006))
    found = clearance(open_surface(flat), open_surface(upright), reach=0.5)
    assert found.crossing and 0.0 <= found.depth <= 0.006
    leaning = Mesh(upright.vertices[:, [2, 1, 0]] + [0.0, 0.0, 0.02], upright.faces)
    found = clearance(open_surface(flat), open_surface(leaning), reach=0.5)
    assert found.crossing and np.linalg.norm(found.point) < 0.6


def test_blades_that_pass_each_other_are_as_far_as_their_edges() -> None:
    one = box((1.0, 0.01, 0.01))
    turned = trimesh.creation.box(extents=(0.01, 1.0, 0.01))
    assert gap(one, mesh(turned, (0.13, 0.07, 0.035))) == pytest.approx(0.025, abs=1e-6)
    tilt = trimesh.transformations.rotation_matrix(0.7, (0, 0, 1))
    rhomb = trimesh.creation.box(extents=(0.01, 0.01, 1.0))
    rhomb.apply_transform(tilt)
    sharp = 0.005 * (np.cos(0.7) + np.sin(0.7))
    assert gap(one, mesh(rhomb, (0.2, 0.03, 0.1))) == pytest.approx(0.03 - 0.005 - sharp, abs=1e-6)


def test_surfaces_that_only_touch_are_neither_deep_nor_apart() -> None:
    assert gap(box((0.2, 0.2, 0.2)), box((0.2, 0.2, 0.2), (0.2, 0.05, 0))) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_holes_do_not_matter_away_from_them(seed: int) -> None:
    whole = ball(0.3)
    holes = np.random.default_rng(seed).choice(len(whole.faces), 60, replace=False)
    kept = np.ones(len(whole.faces), np.bool_)
    kept[holes] = False
    points = _cloud(2000)
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 0.3) > 0.03
    inside = is_inside(open_surface(keeping(whole, kept)), points)
    assert (inside == (radius < 0.3))[clear].all()


def test_a_large_hole_is_capped() -> None:
    whole = ball(0.3)
    kept = whole.vertices[whole.faces][..., 2].max(1) < 0.15  # a bowl
    bowl = open_surface(keeping(whole, kept))
    points = np.array([[0, 0, -0.2], [0, 0, 0.0], [0, 0, 0.25], [0, 0, 0.4], [0.4, 0, 0], [0, 0, -0.4]], np.float64)
    assert is_inside(bowl, points).tolist() == [True, True, False, False, False, False]


def test_flipped_patches_and_a_mesh_inside_out_are_the_same_solid() -> None:
    whole = ball(0.3)
    points = _cloud(2000)
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 0.3) > 0.01
    flipped = whole.faces.copy()
    patch = whole.vertices[whole.faces][..., 0].min(1) > 0.2
    flipped[patch] = flipped[patch][:, ::-1]
    for faces in (flipped, whole.faces[:, ::-1]):
        inside = is_inside(open_surface(Mesh(whole.vertices, np.ascontiguousarray(faces))), points)
        assert (inside == (radius < 0.3))[clear].all()


def test_a_body_that_runs_through_itself_is_solid_there() -> None:
    left, right = ball(0.2, (-0.1, 0, 0)), ball(0.2, (0.1, 0, 0))
    both = Mesh(
        np.concatenate([left.vertices, right.vertices]), np.concatenate([left.faces, right.faces + len(left.vertices)])
    )
    assert is_inside(open_surface(both), np.array([[0.0, 0.0, 0.01], [-0.25, 0, 0], [0.5, 0, 0]])).tolist() == [
        True,
        True,
        False,
    ]


def test_swapping_the_two_changes_nothing() -> None:
    a, b = open_surface(ball(0.1)), open_surface(box((0.2, 0.1, 0.3), (0.15, 0.02, 0.01)))
    one, other = clearance(a, b, reach=0.5), clearance(b, a, reach=0.5)
    assert one.gap == pytest.approx(other.gap, abs=1e-7)
    assert one.swapped().corner_a == other.corner_a
    assert one.swapped().signed_b.tolist() == one.signed_a.tolist()


def test_turning_and_moving_both_changes_nothing() -> None:
    a, b = ball(0.1), box((0.2, 0.1, 0.3), (0.15, 0.02, 0.01))
    turn = trimesh.transformations.euler_matrix(0.3, 0.4, 0.5)[:3, :3]
    moved = [Mesh(m.vertices @ turn.T + [3.0, -2.0, 0.5], m.faces) for m in (a, b)]
    assert gap(moved[0], moved[1]) == pytest.approx(gap(a, b), abs=2e-6)


def test_only_large_faces_get_points_between_their_corners() -> None:
    plate = box((1.0, 1.0, 0.01))
    points, corners = points_of_large_faces(plate.vertices, plate.faces, spacing=0.1)
    assert len(points) == len(corners) > 100
    assert (np.abs(points) <= np.array([0.5, 0.5, 0.005]) + 1e-12).all()
    assert corners.max() < len(plate.vertices)
    assert len(points_of_large_faces(ball(0.1).vertices, ball(0.1).faces, spacing=0.01)[0]) == 0


def test_without_open3d_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest: Any, **options: Any) -> ModuleType:  # noqa: ANN401
        if name == "open3d":
            raise ImportError("libusb-1.0.so.0: cannot open shared object file")
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingLibrary, match=r"libusb-1\.0-0"):
        load_open3d()


def _cloud(n: int) -> FloatArray:
    return np.random.default_rng(5).uniform(-0.45, 0.45, (n, 3))


def test_more_threads_than_processors_are_not_asked_for() -> None:
    """The library below open3d writes a warning of its own if they are, once in a process."""
    asked = """
import os
import numpy as np
from mhvedit.scene.surfaces import open_surface, signed_distances
from mhvedit.sequences.meshes import Mesh
surface = open_surface(Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32)), workers=os.cpu_count() + 2)
signed_distances(surface, np.zeros((5, 3)))
"""
    ran = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")
