"""Batches on real processes: a scheduler and workers on loopback."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from distributed import Client

from mhvedit.batch.cluster import ClusterError
from mhvedit.batch.tasks import BAD, DONE, NO
from mhvedit.pipeline.output import claimed
from mhvedit.pipeline.run import run_scene
from tests.batch.conftest import answers, outputs
from tests.pipeline.toy import Ran, write_scene
from tests.test_examples import example

NOBODY = "tcp://127.0.0.1:1"  # where no scheduler is
FINE = ("voxel = 0.04\nstep = 0.04\nyaw_step = 15", "voxel = 0.03\nstep = 0.03\nyaw_step = 10")
SLOW = "voxel = 0.02\nstep = 0.02\nyaw_step = 5"
Command = Callable[..., Ran]


@pytest.fixture
def scenes(folder: Path) -> list[Path]:
    """Two that can be done, of which one is slower, one that has no answer, and one that is bad."""
    return [
        folder / "scene.toml",
        write_scene(folder, FINE, name="fine"),
        write_scene(folder, ("window = 2.4", "window = 0.2"), name="nowhere"),
        write_scene(folder, ("+&+", "+&&"), name="broken"),
    ]


def test_one_bad_scene_fails_alone(scenes: list[Path], folder: Path, tmp_path: Path, scheduler: str) -> None:
    short = folder / "short"
    shutil.copytree(folder / "anna", short)
    (short / "anna_0003.obj").write_text("v 0 0 0\n")
    scenes.append(write_scene(folder, ('path = "anna"', 'path = "short"'), name="empty-frame"))
    out = tmp_path / "out"
    found = {done.name: done for done in answers(scenes, out, scheduler=scheduler)}
    assert {name: done.verdict for name, done in found.items()} == {
        "scene": DONE, "fine": DONE, "nowhere": NO, "broken": BAD, "empty-frame": BAD,
    }  # fmt: skip
    assert "interaction" in found["broken"].sentences[0] and "broken.toml" in found["broken"].sentences[0]
    assert "anna_0003" in found["empty-frame"].sentences[0] or "frame 3" in found["empty-frame"].sentences[0]
    assert json.loads((out / "summary.json").read_text())["count"] == {DONE: 2, NO: 1, BAD: 2}
    page = (out / "index.html").read_text()
    assert all(name in page for name in found)


def test_the_same_as_solve_and_nothing_to_do_again(scenes: list[Path], tmp_path: Path, scheduler: str) -> None:
    out = tmp_path / "out"
    first = answers(scenes[:3], out, scheduler=scheduler)
    for scene in scenes[:3]:
        run_scene(scene, tmp_path / "alone" / scene.stem, check=False, workers=1)
    alone = outputs(tmp_path / "alone")
    found = outputs(out)
    assert found.keys() == alone.keys()
    assert {name for name in found if found[name] != alone[name] and not name.endswith("scene.json")} == set()
    before = {file: file.stat().st_mtime_ns for file in out.glob("[!.]*/*")}
    assert answers(scenes[:3], out, scheduler=NOBODY) == first, "nobody is asked"
    assert before == {file: file.stat().st_mtime_ns for file in out.glob("[!.]*/*")}


def test_what_changed_is_done_again(scenes: list[Path], folder: Path, tmp_path: Path, scheduler: str) -> None:
    out = tmp_path / "out"
    answers(scenes[:1], out, scheduler=scheduler)
    with pytest.raises(ClusterError, match=f"{NOBODY}: expected a Dask scheduler, found nothing that answers"):
        write_scene(folder, ("window = 2.4", "window = 0.2"))
        answers(scenes[:1], out, scheduler=NOBODY)
    assert json.loads((out / "summary.json").read_text())["missing"] == ["scene"]
    (done,) = answers(scenes[:1], out, scheduler=scheduler)
    assert done.verdict == NO and not (out / "scene" / "edit.json").exists()


def test_a_worker_is_killed(scenes: list[Path], folder: Path, tmp_path: Path, scheduler: str) -> None:
    slow = [write_scene(folder, (FINE[0], SLOW), name="slow"), *scenes[:3]]
    undisturbed, disturbed = tmp_path / "undisturbed", tmp_path / "disturbed"
    answers(slow, undisturbed, scheduler=scheduler)
    finished = threading.Event()

    def kill() -> str:
        """Kill the first worker that is seen in the middle of a segment."""
        with Client(scheduler, set_as_default=False) as client:
            processes = client.run(os.getpid)
            while not finished.is_set():
                for worker, tasks in client.processing().items():
                    if any(str(task).startswith("segment") for task in tasks):
                        os.kill(processes[worker], signal.SIGKILL)
                        return str(worker)
        return ""

    with ThreadPoolExecutor(1) as pool:
        killed = pool.submit(kill)
        found = answers(slow, disturbed, scheduler=scheduler)
        finished.set()
    assert killed.result(), "no worker was seen at work"
    assert [done.verdict for done in found] == [DONE, DONE, DONE, NO]
    assert outputs(disturbed) == outputs(undisturbed)


def test_one_worker_finds_what_two_find(scenes: list[Path], tmp_path: Path, scheduler: str) -> None:
    """On a cluster of its own here."""
    one, two = tmp_path / "one", tmp_path / "two"
    answers(scenes[:3], one, workers=1, solutions=2)
    answers(scenes[:3], two, scheduler=scheduler, solutions=2)
    assert outputs(one) == outputs(two)
    assert (one / "scene-v2" / "edit.json").exists()


def test_further_solutions_are_pinned_elsewhere(scenes: list[Path], tmp_path: Path, scheduler: str) -> None:
    out = tmp_path / "out"
    found = answers(scenes[:1], out, scheduler=scheduler, solutions=3)
    assert [done.name for done in found] == ["scene", "scene-v2", "scene-v3"]
    assert {done.verdict for done in found} == {DONE}
    report = json.loads((out / "scene" / "report.json").read_text())
    pivot = max(report["segments"], key=lambda segment: (segment["regions"], segment["solutions"]))["name"]
    assert len({done.chosen[pivot] for done in found}) == 3
    assert answers(scenes[:1], out, scheduler=NOBODY, solutions=3) == found


def test_the_command(scenes: list[Path], mhvedit: Command, tmp_path: Path, scheduler: str) -> None:
    words = ("-o", tmp_path / "out", "--scheduler", scheduler, "--answer-only")
    assert (ran := mhvedit("batch", scenes[0], *words)).code == 0 and ran.err == "", ran.err
    assert ran.out.startswith("scene  done  16 frames") and ran.out.endswith(
        f"open {tmp_path / 'out' / 'index.html'}\n"
    )
    assert mhvedit("batch", scenes[0], scenes[2], *words).code == 1
    ran = mhvedit("batch", *scenes, *words, "--json")
    assert ran.code == 2 and json.loads(ran.out)["count"] == {DONE: 2, NO: 1, BAD: 1}
    assert "broken.toml" in ran.sentence
    with claimed(tmp_path / "out"):
        assert "no other run is using" in mhvedit("batch", scenes[0], *words).sentence
    assert mhvedit("batch", scenes[0], "-o", tmp_path / "new", "--scheduler", NOBODY).code == 2


def test_solve_with_a_cluster(
    scenes: list[Path], mhvedit: Command, tmp_path: Path, scheduler: str, searches: list[int]
) -> None:
    """Workers search; what is left for this process is to choose."""
    run_scene(scenes[0], tmp_path / "alone" / "scene", check=False)
    searches.clear()
    words = ("solve", scenes[0], "-o", tmp_path / "out" / "scene", "--answer-only", "--scheduler")
    assert mhvedit(*words, scheduler).code == 0 and not searches
    assert outputs(tmp_path / "out") == outputs(tmp_path / "alone")
    assert "expected a Dask scheduler" in mhvedit(*words, NOBODY).sentence
    assert mhvedit("solve", scenes[3], "-o", tmp_path / "bad", "--scheduler", scheduler).code == 2


def test_ctrl_c_and_on_from_there(scenes: list[Path], tmp_path: Path) -> None:
    """SIGINT to the whole group of processes, as a terminal sends it, with a cluster of its own."""
    out = tmp_path / "out"
    words = [sys.executable, "-m", "mhvedit.cli", "batch", *map(str, scenes[:2]), "-o", str(out), "--answer-only"]
    words += ["--workers", "1"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0) as job:
        deadline = time.monotonic() + 60
        while not list(out.glob(".cache/results/volumes/*.npz")) and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(job.pid, signal.SIGINT)
        _, err = job.communicate(timeout=60)
    assert (job.returncode, err) == (130, "mhvedit: interrupted; the next run goes on from here\n")
    assert json.loads((out / "summary.json").read_text())["missing"]
    ran = subprocess.run(words, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")


def test_the_example(tmp_path: Path, scheduler: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = example("batch_synthesis").main(tmp_path / "out", scheduler)
    assert len(found) == 8 and {done.verdict for done in found} == {DONE}
    assert "8 of 8: demo-" in capsys.readouterr().out
