"""Mutual visibility of many poses (eq. 14) against voxel centre by voxel centre."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.constraints.dictionary import ever
from mhvedit.constraints.visibility import SightCone
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.search.columns import turned
from mhvedit.search.sight import a_sees_b, b_sees_a, whole_columns
from mhvedit.volumes.history import MotionHistoryVolume
from tests import oracles
from tests.oracles import Cone, Voxel

PITCH = 0.05


def random_volume(rng: np.random.Generator) -> MotionHistoryVolume:
    """Some solid cells of 8 voxels and some lone voxels."""
    frames = np.zeros((20, 17, 22, 2), np.uint64)
    low = rng.integers(0, 12, 3)
    frames[low[0] : low[0] + 9, low[1] : low[1] + 9, low[2] : low[2] + 9] = rng.random() < 0.5
    frames[tuple(rng.integers(0, 17, (3, 5)))] = [0, 8]
    start = rng.integers(-20, 20, 3)
    return MotionHistoryVolume(
        VoxelGrid((int(start[0]), int(start[1]), int(start[2])), (20, 17, 22), PITCH), frames, 70
    )


def random_cone(rng: np.random.Generator) -> tuple[SightCone, Cone]:
    eye, way = rng.normal(0, 1, 3), rng.normal(0, 1, 3)
    way /= np.linalg.norm(way)
    angle = float(rng.uniform(0.05, 2.8))
    return SightCone(eye, way, angle), ((eye[0], eye[1], eye[2]), (way[0], way[1], way[2]), angle)


def voxels_of(volume: MotionHistoryVolume) -> set[Voxel]:
    return {(int(x), int(y), int(z)) for x, y, z in np.argwhere(volume.filled) + volume.grid.start}


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, derandomize=True)
def test_both_directions_agree_with_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_volume(rng), random_volume(rng)
    yaw = float(rng.uniform(-4, 4))
    base, asked = np.array([-37, -29]), rng.random((70, 66)) < 0.01
    where: dict[str, Any] = {"base": base, "step": PITCH, "asked": asked, "pitch": PITCH}
    (cone_a, plain_a), (cone_b, plain_b) = random_cone(rng), random_cone(rng)
    there = a_sees_b(cone_a, turned(whole_columns(ever(b)), yaw), **where)
    back = b_sees_a(cone_b, turned(whole_columns(ever(a)), 0.0), yaw, **where)
    cells_a, cells_b = dict.fromkeys(voxels_of(a), 0), oracles.turned(dict.fromkeys(voxels_of(b), 0), yaw)
    assert not (there | back)[~asked].any()
    for i, j in np.argwhere(asked).tolist():
        x, y = base[0] + i, base[1] + j
        assert there[i, j] == oracles.in_cone(plain_a, oracles.moved(cells_b, (x, y)), PITCH)
        assert back[i, j] == oracles.in_cone(moved_cone(plain_b, x, y, yaw), cells_a, PITCH)


def one_shift(size: int = 1) -> dict[str, Any]:
    return {"base": np.zeros(2, np.int64), "step": PITCH, "asked": np.ones((size, size), np.bool_), "pitch": PITCH}


def moved_cone(cone: Cone, x: int, y: int, yaw: float) -> Cone:
    (ex, ey, ez), (dx, dy, dz), angle = cone
    c, s = np.cos(yaw), np.sin(yaw)
    eye = c * ex - s * ey + x * PITCH, s * ex + c * ey + y * PITCH, ez
    return eye, (c * dx - s * dy, s * dx + c * dy, dz), angle


@pytest.mark.parametrize(("angle", "seen"), [(44.0, False), (46.0, True), (134.0, True)])
def test_a_voxel_45_degrees_off_the_gaze_is_seen_from_that_half_angle_on(angle: float, seen: bool) -> None:
    dot = MotionHistoryVolume(VoxelGrid((10, 0, 10), (1, 1, 1), PITCH), np.ones((1, 1, 1, 1), np.uint64), 1)
    cone = SightCone(np.zeros(3), np.array([1.0, 0, 0]), np.deg2rad(angle))
    assert a_sees_b(cone, turned(whole_columns(ever(dot)), 0.0), **one_shift())[0, 0] == seen


def test_nothing_is_seen_of_an_empty_volume() -> None:
    empty = MotionHistoryVolume(VoxelGrid((0, 0, 0), (1, 1, 1), PITCH), np.zeros((1, 1, 1, 1), np.uint64), 1)
    cone = SightCone(np.zeros(3), np.array([1.0, 0, 0]), 3.0)
    assert not a_sees_b(cone, turned(whole_columns(ever(empty)), 1.0), **one_shift(4)).any()
