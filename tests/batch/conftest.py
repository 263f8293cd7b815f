import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mhvedit.batch.asked import asked_scenes
from mhvedit.batch.run import Options, run_batch
from mhvedit.batch.tasks import SceneDone
from tests.pipeline.conftest import captures, folder, mhvedit, searches

__all__ = ["captures", "folder", "mhvedit", "searches"]  # fixtures
TIMES = ("seconds", "answer_seconds")  # of report.json, which differ from run to run


@pytest.fixture(scope="session")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a scheduler with two workers, all processes of their own, on loopback."""
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    options = ["--no-dashboard", "--host", "127.0.0.1"]
    commands = [
        ["distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", str(file), *options],
        ["distributed.cli.dask_worker", "--nworkers", "2", "--nthreads", "1", "--scheduler-file", str(file), *options],
    ]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    running = []
    try:
        for command in commands:
            running.append(subprocess.Popen([sys.executable, "-m", *command], **quiet))  # type: ignore[call-overload]
            while not file.exists():
                time.sleep(0.05)
        yield str(json.loads(file.read_text())["address"])
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait()


def answers(scenes: list[Path], out: Path, *, solutions: int = 1, **options: object) -> tuple[SceneDone, ...]:
    """A batch without the check on the meshes, which is slow."""
    settings = Options(check=False, report=False, **options)  # type: ignore[arg-type]
    return run_batch(asked_scenes(scenes, out, solutions=solutions), out, options=settings)


def outputs(out: Path) -> dict[str, object]:
    """Everything in the scenes' folders but times: bytes by name, JSON of reports without what a clock says."""
    found: dict[str, object] = {}
    for file in sorted(out.glob("*/**/*")):
        name = file.relative_to(out)
        if file.is_dir() or any(part.startswith(".") for part in name.parts):
            continue
        if file.name == "report.json":
            found[str(name)] = {k: v for k, v in json.loads(file.read_text()).items() if k not in TIMES}
        else:
            found[str(name)] = file.read_bytes()
    return found
