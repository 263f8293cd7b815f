import numpy as np
import pytest

from mhvedit.scene.shells import CELL, SPACING, cells_of, shell_of, stacked, touching
from mhvedit.scene.surfaces import clearance, open_surface
from mhvedit.sequences.meshes import Mesh
from tests.pipeline.toy import CORNERS, FACES


def block(size: tuple[float, float, float], at: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    return Mesh((CORNERS - 0.5) * np.array(size) + np.array(at), FACES.astype(np.int32))


def test_a_shell_covers_large_faces_and_is_thin() -> None:
    points = shell_of(block((0.4, 0.3, 1.7)))
    assert len(points) < 1.2 * len(np.unique(np.floor(points / SPACING), axis=0))
    rng = np.random.default_rng(0)
    side = np.column_stack([np.full(200, 0.2), rng.uniform(-0.15, 0.15, 200), rng.uniform(-0.85, 0.85, 200)])
    away = np.linalg.norm(side[:, None] - points[None], axis=2).min(1)
    assert away.max() < 1.5 * SPACING


@pytest.mark.parametrize("seed", range(20))
def test_those_whose_shells_do_not_touch_do_not_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = block((0.3, 0.5, 1.0)), block((0.5, 0.2, 0.8), (0.1, 0.0, 0.2))
    poses = np.column_stack([rng.uniform(-0.7, 0.7, (30, 2)), rng.uniform(-3, 3, 30)])
    nothing = np.zeros(30, np.int64)
    count = touching(
        stacked([shell_of(one)]), cells_of(stacked([shell_of(other)])), frames=(nothing, nothing), relative=poses
    )
    for (x, y, yaw), met in zip(poses, count, strict=True):
        c, s = np.cos(yaw), np.sin(yaw)
        placed = Mesh(one.vertices @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (x, y, 0), one.faces)
        gap = clearance(open_surface(placed), open_surface(other), reach=1.0).gap
        assert met or gap > 0
        assert not met or gap < 4 * CELL


def test_frames_have_their_own_shells() -> None:
    low, high = shell_of(block((0.2, 0.2, 0.2))), shell_of(block((0.2, 0.2, 0.2), (0, 0, 1)))
    shells, cells = stacked([low, high]), cells_of(stacked([high, low]))
    ours, theirs = np.array([0, 0, 1, 1, 0]), np.array([0, 1, 0, 1, -1])
    count = touching(shells, cells, frames=(ours, theirs), relative=np.zeros((5, 3)))
    assert (count > 0).tolist() == [False, True, True, False, False]
    first = touching(shells, cells, frames=(ours, theirs), relative=np.zeros((5, 3)), first=True)
    assert (first > 0).tolist() == [False, True, False, False, False]
