"""Surface labels by their definition (Shi et al., section 3.2; its equations, not its prose)."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.grid import VoxelGrid
from mhvedit.volumes.history import MotionHistoryVolume, history
from mhvedit.volumes.surface import SurfaceLabel, surface_labels, surface_voxels

NEIGHBOURS = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def random_volume(rng: np.random.Generator, tau: int) -> MotionHistoryVolume:
    grid = VoxelGrid((-3, 2, 0), (6, 5, 7), 0.02)
    return history([(grid, rng.random(grid.shape) < rng.choice([0.2, 0.8])) for _ in range(tau)])


@given(seed=st.integers(0, 2**32 - 1), tau=st.sampled_from([1, 2, 4, 66]))
@settings(max_examples=20, derandomize=True)
def test_labels_are_by_first_and_last_frame_on_the_surface_only(seed: int, tau: int) -> None:
    volume = random_volume(np.random.default_rng(seed), tau)
    labels, filled = surface_labels(volume), volume.filled
    around = np.pad(filled, 1)
    for x, y, z in np.ndindex(filled.shape):
        when = [i for i in range(tau) if volume.at(i)[x, y, z]] if tau < 10 else []
        open_sided = any(not around[x + 1 + i, y + 1 + j, z + 1 + k] for i, j, k in NEIGHBOURS)
        label = SurfaceLabel(int(labels[x, y, z]))
        assert bool(label) == bool(filled[x, y, z] and open_sided)
        if label and when:
            assert (SurfaceLabel.START in label) == (when[0] == 0)
            assert (SurfaceLabel.END in label) == (when[-1] == tau - 1)
            assert (SurfaceLabel.LATERAL in label) == (when[0] > 0 and when[-1] < tau - 1)


def test_a_voxel_that_never_moves_is_both_start_and_end() -> None:
    grid = VoxelGrid((0, 0, 0), (1, 1, 1), 0.02)
    still = history([(grid, np.ones((1, 1, 1), np.bool_))] * 5)
    assert surface_labels(still)[0, 0, 0] == SurfaceLabel.START | SurfaceLabel.END


def test_a_sweeping_voxel_starts_passes_and_ends() -> None:
    grid = VoxelGrid((0, 0, 0), (4, 1, 1), 0.02)
    sweep = history([(grid, np.arange(4).reshape(4, 1, 1) == i) for i in range(4)])
    names = [SurfaceLabel.START, SurfaceLabel.LATERAL, SurfaceLabel.LATERAL, SurfaceLabel.END]
    assert surface_labels(sweep)[:, 0, 0].tolist() == names


def test_the_surface_of_a_cube_is_its_outer_layer_and_that_of_a_shell_both_sides() -> None:
    cube = np.ones((5, 5, 5), np.bool_)
    assert surface_voxels(cube).sum() == 125 - 27
    cube[2, 2, 2] = False
    assert surface_voxels(cube).sum() == 125 - 27 + 6
    assert surface_voxels(np.ones((1, 4, 1), np.bool_)).all()
