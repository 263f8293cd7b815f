"""What the documentation says is there is there, and its scripts run."""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.pipeline.job import Job
from mhvedit.project.scene_file import parse_scene
from mhvedit.project.schema import SearchSettings

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "data" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
COARSE = SearchSettings(voxel=0.02, step=0.04, yaw_step=math.radians(12))
MOST_BYTES = 400_000  # of a picture


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def heading_names(page: Path) -> set[str]:
    """Anchors as they are made of headings."""
    lines = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://")):
            continue
        file, _, anchor = link.partition("#")
        target = page.parent / file if file else page
        assert target.exists(), link
        assert not anchor or anchor in heading_names(target), link


def test_pictures_are_small() -> None:
    pictures = list((ROOT / "docs" / "pictures").iterdir())
    assert pictures
    assert all(picture.stat().st_size < MOST_BYTES for picture in pictures)


@pytest.mark.parametrize("name", ["README.md", "docs/tutorial.md"])
def test_scene_files_on_a_page_load(name: str, tmp_path: Path) -> None:
    for folder in ("anna", "anna_sword", "ben", "ben_sword"):
        (tmp_path / folder).mkdir()
    (tmp_path / "anna.csv").write_text("frame,joint,x,y,z\n")
    found = [block for block in blocks(ROOT / name, "toml") if "version" in tomllib.loads(block)]
    assert found
    for block in found:
        assert parse_scene(block, tmp_path / "scene.toml").segments


def test_functions_and_tests_of_the_paper_table_are_there() -> None:
    tests = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    rows = re.findall(r"^\|.*`test_\w+`.*\|$", (ROOT / "docs" / "papers.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) > 15
    for row in rows:
        for test in re.findall(r"`(test_\w+)`", row):
            assert f"def {test}(" in tests, test
        functions = re.findall(r"`((?:\w+\.)*\w+)`", row.split("|")[3])
        module = ""
        for function in functions:
            place, _, name = function.rpartition(".")
            module = place or module
            source = ROOT / "mhvedit" / f"{module.replace('.', '/')}.py"
            assert f"def {name}(" in source.read_text(encoding="utf-8"), function


def test_the_python_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def load(path: str) -> Job:
        assert path == "scene.toml"
        job = whole(bundled_scene("short"))
        return replace(job, scene=replace(job.scene, search=COARSE))

    whole = api.load
    monkeypatch.setattr(api, "load", load)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(ROOT / "docs" / "python.md", "python"):
        exec(compile(block, "docs/python.md", "exec"), names)
    assert (tmp_path / "out" / "edit.json").exists()
