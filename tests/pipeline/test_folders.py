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


@pytest.fixture
def unanswered(tmp_path: Path) -> Path:
    """An output folder of `mhvedit solve` in which nothing fitted, as far as it is looked at."""
    out = tmp_path / "unanswered"
    out.mkdir()
    (out / "report.json").write_text(json.dumps({"solved": False, "failure": '"raise" has no solution'}))
    (out / "report.html").write_text("a page")
    return out


def test_a_scene_without_an_answer_is_not_checked_and_the_answer_is_no(mhvedit: Command, unanswered: Path) -> None:
    said = f'{unanswered}: no answer: "raise" has no solution; see report.html'
    ran = mhvedit("check", unanswered)
    assert (ran.code, ran.out, ran.err) == (1, f"{said}\n", "")
    ran = mhvedit("check", unanswered, "--json")
    assert (ran.code, json.loads(ran.out)["problems"]) == (1, [said])


def test_a_scene_without_an_answer_is_not_exported(mhvedit: Command, unanswered: Path, tmp_path: Path) -> None:
    (unanswered / "report.html").unlink()
    ran = mhvedit("export", unanswered, "--to", tmp_path / "a.glb")
    said = f'{unanswered}: no answer: "raise" has no solution; see report.json'
    assert (ran.code, ran.sentence) == (2, said) and not (tmp_path / "a.glb").exists()


@pytest.mark.parametrize(("words", "to_be"), [(("check",), "checked"), (("export", "--to", "a.glb"), "exported")])
def test_a_motion_is_neither_checked_nor_exported(
    mhvedit: Command, avoided: Path, words: tuple[str, ...], to_be: str
) -> None:
    ran = mhvedit(*words, avoided)
    found = f"one of `mhvedit avoid`; only scenes are {to_be}"
    assert (ran.code, ran.sentence) == (2, f"{avoided}: expected an output folder of `mhvedit solve`, found {found}")


def test_what_avoid_prints_has_a_line_for_each_entry_and_one_frame_is_one(
    mhvedit: Command, walking: Path, tmp_path: Path
) -> None:
    ran = mhvedit("avoid", walking, "-o", tmp_path / "out", "--no-report", "--json")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert json.loads(ran.out) == report and len(ran.out.splitlines()) == len(report) + 2
    take = bvh_of(figure(), walk(1))
    write_bvh_motion(walking, take, take.motion)
    ran = mhvedit("avoid", walking, "-o", tmp_path / "out", "--no-report")
    assert ran.out.startswith("1 frame, colliding ")


def test_a_scene_file_is_told_without_detours(
    mhvedit: Command, solved: tuple[Path, Outcome], folder: Path, tmp_path: Path
) -> None:
    out = Path(shutil.copytree(solved[0], tmp_path / "out"))
    (out / "scene.json").write_text(json.dumps({"scene": "../job/scene.toml"}))
    (folder / "scene.toml").write_text("version = 2\n")
    for words in (("check", out), ("view", out, "--shot", tmp_path / "a.png")):
        assert mhvedit(*words).sentence.startswith(f"{folder}/scene.toml: version: ")
