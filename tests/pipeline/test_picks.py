"""What pins and exclusions in the scene file do to a solve."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.pipeline.assemble import captured_poses
from mhvedit.pipeline.job import mirrored_spot
from mhvedit.pipeline.picks import canonical_frames, idle_exclusions, is_excluded
from mhvedit.pipeline.run import Outcome
from mhvedit.project.schema import Exclusion, SegmentSpec, Spot

Solved = tuple[Path, Outcome]


def spot_of(result: api.Result, row: int) -> Spot:
    segment = result.segment("raise")
    pose = captured_poses(segment.group.poses[[row]], result.people["anna"], result.people["ben"])[0]
    return Spot(*(round(float(v), 4) for v in pose))


def chosen_with(result: api.Result, *, pin: Spot | None = None, exclude: tuple[Exclusion, ...] = ()) -> api.Result:
    """The scene chosen anew with other decisions on its first segment."""
    first, second = result.job.scene.segments
    scene = replace(result.job.scene, segments=(replace(first, pin=pin, exclude=exclude), second))
    return api.choose(replace(result, job=replace(result.job, scene=scene)), {})


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
def test_a_pinned_solution_is_chosen(solved: Solved, share: float) -> None:
    result = solved[1].result
    row = int(share * result.segment("raise").n_solutions)
    pinned = chosen_with(result, pin=spot_of(result, row))
    assert pinned.assembly is not None and pinned.assembly.chosen[0] == row


def test_a_pin_beside_the_lattice_means_the_nearest(solved: Solved) -> None:
    result = solved[1].result
    spot = spot_of(result, 40)
    moved = Spot(spot.x + 0.01, spot.y - 0.01, spot.yaw)
    assert chosen_with(result, pin=moved).assembly.chosen[0] == 40  # type: ignore[union-attr]


def test_a_pin_that_is_no_solution_is_no_answer(solved: Solved) -> None:
    result = solved[1].result
    spot = spot_of(result, 40)
    lost = chosen_with(result, pin=Spot(spot.x + 5.0, spot.y, spot.yaw))
    assert lost.assembly is None
    assert str(lost.failure).startswith('"raise": `pin` is no solution any more; the nearest is 4')


def test_a_pin_in_the_file_survives_a_solve(folder: Path, solved: Solved) -> None:
    result = solved[1].result
    spot = spot_of(result, 100)
    scene = folder / "scene.toml"
    pin = f"pin = {{x = {spot.x}, y = {spot.y}, yaw = {np.degrees(spot.yaw)}}}"
    scene.write_text(scene.read_text().replace('interaction = "+&+"', f'interaction = "+&+"\n{pin}'))
    again = api.solve(api.load(scene), workers=1)
    assert again.assembly is not None and again.assembly.chosen[0] == 100


def test_an_excluded_region_is_never_chosen(solved: Solved) -> None:
    result = solved[1].result
    segment = result.segment("raise")
    there = spot_of(result, int(np.flatnonzero(segment.group.region == 0)[5]))
    left = is_excluded(
        Exclusion(there, None), segment.group, segment.grid, frames=canonical_frames(segment, result.people)
    )
    np.testing.assert_array_equal(left, segment.group.region == 0)
    without = chosen_with(result, exclude=(Exclusion(there, None),))
    if (segment.group.region > 0).any():
        assert without.assembly is not None and segment.group.region[without.assembly.chosen[0]] > 0
    else:
        n = segment.n_solutions
        assert str(without.failure) == f'"raise": `exclude` leaves none of its {n} solutions'


@pytest.mark.parametrize("turn", [0.3, np.pi])
def test_a_neighbourhood_is_what_lies_within_it(solved: Solved, turn: float) -> None:
    result = solved[1].result
    segment = result.segment("raise")
    assert result.assembly is not None
    row = result.assembly.chosen[0]
    near = Exclusion(spot_of(result, row), 0.2, turn)
    gone = is_excluded(near, segment.group, segment.grid, frames=canonical_frames(segment, result.people))
    poses = segment.group.poses
    roots = (rotation(poses[:, 2]) @ segment.grid.root_b) + poses[:, :2]
    away = np.linalg.norm(roots - roots[row], axis=1)
    turned = np.abs(wrap_angle(poses[:, 2] - poses[row, 2]))
    clear = (np.abs(away - 0.2) > 1e-3) & (np.abs(turned - turn) > 1e-3)
    np.testing.assert_array_equal(gone[clear], ((away <= 0.2) & (turned <= turn))[clear])
    assert gone.any() and not gone.all()
    moved = chosen_with(result, exclude=(near,))
    assert moved.assembly is not None and not gone[moved.assembly.chosen[0]]


def test_a_pin_is_stronger_than_an_exclusion(solved: Solved) -> None:
    result = solved[1].result
    spot = spot_of(result, 40)
    both = chosen_with(result, pin=spot, exclude=(Exclusion(spot, None),))
    assert both.assembly is not None and both.assembly.chosen[0] == 40


def test_an_exclusion_of_nothing_is_told(solved: Solved) -> None:
    result = solved[1].result
    spot = spot_of(result, 40)
    exclude = (Exclusion(spot, None), Exclusion(Spot(spot.x + 9, spot.y, spot.yaw), None))
    specs: list[SegmentSpec] = [replace(result.job.scene.segments[0], exclude=exclude), result.job.scene.segments[1]]
    told = idle_exclusions(specs, result.segments, result.people)
    assert told == ('"raise": exclude[1] leaves out no solution: none is there any more',)


def test_a_spot_mirrored_twice_is_itself() -> None:
    spot = Spot(0.3, -1.2, 2.0)
    back = mirrored_spot(mirrored_spot(spot))
    assert (back.x, back.y, back.yaw) == pytest.approx((spot.x, spot.y, spot.yaw))
