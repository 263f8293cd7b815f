import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from mhvedit import api
from mhvedit.pipeline.output import CACHE
from mhvedit.viewer.decisions import decisions_of
from mhvedit.viewer.opening import open_scene
from mhvedit.viewer.session import Session, open_session
from mhvedit.viewer.state import ViewerState, in_segment, started
from tests.pipeline.conftest import mhvedit, searches
from tests.pipeline.toy import ANNA, BEN, write_actor, write_scene

__all__ = ["mhvedit", "searches"]  # fixtures that are shared


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the toy captures, their scene file and its solved output `out`; not to be written into."""
    folder = tmp_path_factory.mktemp("viewed")
    write_actor(folder, "anna", ANNA)
    write_actor(folder, "ben", BEN)
    scene = write_scene(folder)
    api.write(api.solve(api.load(scene, cache=folder / "out" / CACHE), workers=1), folder / "out")
    return folder


@pytest.fixture(scope="session")
def result(made: Path) -> api.Result:
    return api.solve(api.load(made / "scene.toml", cache=made / "out" / CACHE), workers=1)


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(made, tmp_path / "job"))


@pytest.fixture(scope="session")
def state(made: Path) -> ViewerState:
    """The solved toy scene, at the end of its first segment, where the hands meet."""
    opened = open_scene(made / "out")
    assert opened.job is not None and not opened.stale
    return in_segment(started(opened.material, decisions_of(opened.job.scene)).now, "raise")


@pytest.fixture
def session(folder: Path) -> Iterator[Session]:
    """A viewer of the solved toy scene in a folder of its own."""
    made = open_session(folder / "out", workers=1)
    yield made
    made.close()
