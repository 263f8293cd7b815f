"""The Python interface: look at a group, pick another solution, write."""

from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.errors import OutputBusy, SceneError
from mhvedit.geometry.planar import compose, invert
from mhvedit.pipeline.output import claimed
from mhvedit.pipeline.run import Outcome

Solved = tuple[Path, Outcome]


def test_a_picked_solution_is_taken(solved: Solved, tmp_path: Path) -> None:
    result = solved[1].result
    for row in (0, len(result.segment("raise").group) - 1):
        picked = api.choose(result, {"raise": row})
        assert picked.assembly is not None and picked.assembly.chosen[0] == row
        api.write(picked, tmp_path / "out")
        edit = api.read_edit(tmp_path / "out" / "edit.json")
        with np.load(tmp_path / "out" / "solutions" / "raise.npz") as group:
            wanted = np.array([group[key][row] for key in ("x", "y", "yaw")])
        np.testing.assert_allclose(edit.segments[0].relative, wanted, atol=1e-12)
        a, b = (edit.subjects[name].placements[3] for name in ("anna", "ben"))
        np.testing.assert_allclose(compose(invert(a), b)[:2], wanted[:2], atol=1e-9)


def test_the_chain_chooses_the_others(solved: Solved) -> None:
    result = solved[1].result
    group = result.segment("raise").group
    row = int(np.flatnonzero((group.keys[:, None] == result.segment("lower").group.keys).all(2).any(1))[0])
    picked = api.choose(result, {"raise": row}).assembly
    assert picked is not None and picked.scene.cost == 0.0
    np.testing.assert_array_equal(picked.scene.segments[0].relative, picked.scene.segments[1].relative)
    both = api.choose(result, {"raise": 0, "lower": len(result.segment("lower").group) - 1}).assembly
    assert both is not None and both.scene.cost > 0
    assert api.choose(result, {}).assembly.scene.cost == 0.0  # type: ignore[union-attr]


@pytest.mark.parametrize("row", [-1, 736, 10**9])
def test_a_row_that_is_not_there(solved: Solved, captures: Path, row: int) -> None:
    result = solved[1].result
    last = len(result.segment("raise").group) - 1
    with pytest.raises(SceneError) as fault:
        api.choose(result, {"raise": last + 1 if row == 736 else row})
    found = last + 1 if row == 736 else row
    assert str(fault.value) == f"{captures}/scene.toml: pick raise: expected a row from 0 to {last}, found {found}"


def test_a_segment_that_is_not_there(solved: Solved, captures: Path) -> None:
    with pytest.raises(SceneError) as fault:
        api.choose(solved[1].result, {"rise": 0})
    assert str(fault.value) == f"{captures}/scene.toml: pick: expected a segment of raise, lower, found 'rise'"


def test_writing_where_another_run_is_at_work(solved: Solved, tmp_path: Path) -> None:
    with claimed(tmp_path / "out"), pytest.raises(OutputBusy):
        api.write(solved[1].result, tmp_path / "out")
