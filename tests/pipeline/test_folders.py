"""Whose output folder one is, and what becomes of somebody else's."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from mhvedit.pipeline.run import Outcome
from mhvedit.skeleton.bvh_motion import bvh_of, write_bvh_motion
from tests.avoidance.figures import figure
from tests.avoidance.scenes import walk
from tests.pipeline.toy import Ran

Command = Callable[..., Ran]
AVOIDED = {"motion": "walk.bvh", "method": "bisection", "converged": True, "why": [], "pairs": []}

pytestmark = pytest.mark.usefixtures("unmeasured")


def whole(out: Path) -> dict[str, bytes]:
    """All files, hidden ones too."""
    return {str(file.relative_to(out)): file.read_bytes() for file in out.rglob("*") if file.is_file()}


@pytest.fixture
def walking(tmp_path: Path) -> Path:
    """A person who walks, as a BVH."""
    take = bvh_of(figure(), walk(2))
    write_bvh_motion(tmp_path / "walk.bvh", take, take.motion)
    return tmp_path / "walk.bvh"


@pytest.fixture
def avoided(tmp_path: Path) -> Path:
    """An output folder of `mhvedit avoid`, as far as it is looked at."""
    out = tmp_path / "avoided"
    out.mkdir()
    (out / "report.json").write_text(json.dumps(AVOIDED))
    return out


def test_solve_leaves_a_folder_of_avoid_alone(mhvedit: Command, captures: Path, avoided: Path) -> None:
    before = whole(avoided)
    ran = mhvedit("solve", captures / "scene.toml", "-o", avoided)
    expected = "expected an output folder of `mhvedit solve`, or a new one, found one of `mhvedit avoid`"
    assert (ran.code, ran.sentence) == (2, f"{avoided}: {expected}")
    assert whole(avoided) == before


def test_avoid_leaves_a_folder_of_solve_alone(
    mhvedit: Command, solved: tuple[Path, Outcome], walking: Path, tmp_path: Path
) -> None:
    out = Path(shutil.copytree(solved[0], tmp_path / "out"))
    before = whole(out)
    ran = mhvedit("avoid", walking, "-o", out)
    expected = "expected an output folder of `mhvedit avoid`, or a new one, found one of `mhvedit solve`"
    assert (ran.code, ran.sentence) == (2, f"{out}: {expected}")
    assert whole(out) == before


def test_the_same_command_writes_again_and_beside_what_is_nobodys(
    mhvedit: Command, walking: Path, tmp_path: Path
) -> None:
    for _ in range(2):
        assert mhvedit("avoid", walking, "-o", tmp_path, "--no-report").code in (0, 1)
    assert walking.exists() and (tmp_path / "motion.bvh").exists()
