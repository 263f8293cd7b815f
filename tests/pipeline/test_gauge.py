"""What must not matter: how a capture stands in its own world, who is called A, and a coarser grid of poses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mhvedit import api
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, wrap_angle
from mhvedit.pipeline.job import Result
from tests.pipeline.toy import ANNA, BEN, LOWER_TABLE, Actor, write_actor, write_scene

LEFT = replace(BEN, left_from=8)
NPZ = (('path = "anna"', 'path = "anna.npz"'), ('path = "ben"', 'path = "ben.npz"'))
MIRRORED = LOWER_TABLE.replace('["anna", "ben"]', '["ben", "anna"]')
FEW = settings(max_examples=4, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])


def solve(folder: Path, *changes: tuple[str, str], anna: Actor = ANNA, ben: Actor = LEFT) -> Result:
    folder.mkdir(exist_ok=True)
    write_actor(folder, "anna", anna, kind="npz")
    write_actor(folder, "ben", ben, kind="npz")
    return api.solve(api.load(write_scene(folder, *NPZ, *changes)))


def tips(result: Result) -> FloatArray:
    """(N, 2, V, 3) all vertices of both through the scene, where they stand."""
    assert result.assembly is not None
    scene = result.assembly.scene
    captures = {name: person.sequence for name, person in result.people.items()}
    return np.array(
        [
            [api.placed_mesh(scene, captures, name, frame).vertices for name in ("anna", "ben")]
            for frame in range(scene.n_frames)
        ]
    )


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The poses must change between the two segments: Ben changes hands."""
    return solve(tmp_path_factory.mktemp("plain"))


def test_ben_changes_hands(plain: Result) -> None:
    assert plain.assembly is not None and plain.assembly.scene.cost > 1e-6
    assert plain.assembly.scene.gap < 1


@given(
    anna=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4)),
    ben=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4)),
)
@FEW
def test_turning_and_shifting_a_capture(
    plain: Result,
    tmp_path: Path,
    anna: tuple[float, float, float],
    ben: tuple[float, float, float],
) -> None:
    moved = solve(tmp_path, anna=replace(ANNA, place=anna), ben=replace(LEFT, place=ben))
    assert moved.assembly is not None and plain.assembly is not None
    for before, after in zip(plain.segments, moved.segments, strict=True):
        np.testing.assert_array_equal(before.group.keys, after.group.keys)
        np.testing.assert_allclose(before.group.distance, after.group.distance, atol=1e-9)
        np.testing.assert_allclose(wrap_angle(before.group.theta_a - after.group.theta_a), 0, atol=1e-9)
        np.testing.assert_allclose(wrap_angle(before.group.theta_b - after.group.theta_b), 0, atol=1e-9)
    assert moved.assembly.chosen == plain.assembly.chosen
    assert moved.assembly.scene.cost == pytest.approx(plain.assembly.scene.cost, abs=1e-9)
    np.testing.assert_allclose(in_annas_frame(moved, anna), in_annas_frame(plain, ANNA.place), atol=1e-6)


def in_annas_frame(result: Result, place: tuple[float, float, float]) -> FloatArray:
    """All vertices, seen from where Anna's capture stood: hers is the scene's world."""
    back = tips(result) - np.array([place[0], place[1], 0.0])
    return np.asarray(apply_pose(np.array([0.0, 0.0, -place[2]]), back.reshape(-1, 3))).reshape(back.shape)


def test_who_is_a_in_one_of_two_segments(plain: Result, tmp_path: Path) -> None:
    swapped = solve(tmp_path, (LOWER_TABLE, MIRRORED))
    assert swapped.assembly is not None and plain.assembly is not None
    np.testing.assert_array_equal(tips(swapped), tips(plain))
    assert swapped.assembly.scene.cost == plain.assembly.scene.cost


@pytest.mark.parametrize(("there", "back"), [("+&-", "-&+"), ("+&0", "0&+"), ("0&-", "-&0")])
def test_a_lopsided_type_is_mirrored(tmp_path: Path, there: str, back: str) -> None:
    one = LOWER_TABLE.replace('"-&-"', f'"{there}"')
    other = MIRRORED.replace('"-&-"', f'"{back}"')
    found = [solve(tmp_path / name, (LOWER_TABLE, text)) for name, text in (("one", one), ("other", other))]
    groups = [result.segment("lower").group for result in found]
    np.testing.assert_array_equal(groups[0].keys, groups[1].keys)


def test_who_is_a_in_all_segments(plain: Result, tmp_path: Path) -> None:
    """The poses of Anna beside Ben lie on another lattice, so the answer may differ by a step of the grid."""
    swapped = solve(tmp_path, ('between = ["anna", "ben"]', 'between = ["ben", "anna"]'))
    assert swapped.assembly is not None and plain.assembly is not None
    step, yaw_step = plain.job.scene.search.step, plain.job.scene.search.yaw_step
    for one, other in ((plain, swapped), (swapped, plain)):
        for a, b in zip(one.segments, other.segments, strict=True):
            assert len(b.group) == pytest.approx(len(a.group), rel=0.1)
    chosen = [(s.distance, s.theta_a, s.theta_b) for s in plain.assembly.scene.segments]
    turned = [(s.distance, s.theta_b, s.theta_a) for s in swapped.assembly.scene.segments]
    error = np.array(chosen) - np.array(turned)
    assert np.abs(error[:, 0]).max() < 1.5 * step
    assert np.abs(wrap_angle(error[:, 1:])).max() < 1.5 * yaw_step
    assert swapped.assembly.scene.cost == pytest.approx(plain.assembly.scene.cost, abs=0.02)


@pytest.mark.parametrize("coarser", [("step = 0.04", "step = 0.08"), ("yaw_step = 15", "yaw_step = 30")])
def test_a_finer_grid_loses_nothing(plain: Result, tmp_path: Path, coarser: tuple[str, str]) -> None:
    coarse = solve(tmp_path, coarser)
    for few, many in zip(coarse.segments, plain.segments, strict=True):
        assert 0 < len(few.group) < len(many.group)
        fine = {tuple(pose) for pose in np.round(many.group.poses, 9)}
        assert {tuple(pose) for pose in np.round(few.group.poses, 9)} <= fine
