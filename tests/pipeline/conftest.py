import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mhvedit import cli
from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import NO_CONTACT
from mhvedit.pipeline import misses, run, stages
from mhvedit.pipeline.measure import measure_scene
from mhvedit.pipeline.run import Outcome, run_scene
from mhvedit.scene.report import SceneReport
from mhvedit.search.solve import search_poses
from tests.pipeline.toy import ANNA, BEN, Ran, write_actor, write_scene


@pytest.fixture(scope="session")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both captures as OBJ with their tracks, and the scene file; not to be written into."""
    folder = tmp_path_factory.mktemp("toy")
    write_actor(folder, "anna", ANNA)
    write_actor(folder, "ben", BEN)
    write_scene(folder)
    return folder


@pytest.fixture
def folder(captures: Path, tmp_path: Path) -> Path:
    """A copy of the captures that a test may spoil."""
    return Path(shutil.copytree(captures, tmp_path / "job"))


@pytest.fixture(scope="session")
def solved(captures: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    """The output folder of the toy scene, and what the run came to; not to be written into."""
    out = tmp_path_factory.mktemp("solved") / "out"
    return out, run_scene(captures / "scene.toml", out, workers=1, report=False)


@pytest.fixture
def mhvedit(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Ran]:
    """The command line, in this process."""

    def call(*words: str | Path) -> Ran:
        monkeypatch.setattr(sys, "argv", ["mhvedit", *map(str, words)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            cli.main()
        assert isinstance(left.value.code, int)
        return Ran(left.value.code, *capsys.readouterr())

    return call


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by the size of the grid with every search for contact that is made."""
    made: list[int] = []

    def counted(grid: object, clauses: Sequence[Clause], **options: object) -> object:
        if clauses and clauses[0].reason == NO_CONTACT:
            made.append(grid.size)  # type: ignore[attr-defined]
        return search_poses(grid, clauses, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(stages, "search_poses", counted)
    monkeypatch.setattr(misses, "search_poses", counted)
    return made


@pytest.fixture(scope="session")
def measured(solved: tuple[Path, Outcome]) -> SceneReport:
    """What the check on the meshes says of the toy scene."""
    result = solved[1].result
    assert result.assembly is not None
    return measure_scene(result.job, result.people, result.assembly.scene)


@pytest.fixture
def unmeasured(measured: SceneReport, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check on the meshes, which is slow, says the same whatever the scene is."""
    monkeypatch.setattr(run, "measure_scene", lambda *scene, **options: measured)
