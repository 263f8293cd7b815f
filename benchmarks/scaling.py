"""How a batch scales: eight scenes on one and on two workers, and a model of up to 1,000 workers that is held to that.

    python -m benchmarks.scaling [--write]

The scenes are cuts of the bundled sword fight that share no segment. Workers have one thread, held to one core each,
and are warm: each has solved another scene before. `--write` makes docs/scaling.md and its picture.
"""

import argparse
import json
import os
import resource
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import tomlkit
from distributed import get_task_stream

from benchmarks.cluster_model import Machinery
from benchmarks.duel import BUNDLED
from benchmarks.kept_figures import machine
from benchmarks.scaling_page import Measured, predicted, scenes_of, write_page
from mhvedit.batch.asked import asked_scenes
from mhvedit.batch.cluster import Client, connected
from mhvedit.batch.run import Options, run_batch
from mhvedit.batch.template import moved_content
from mhvedit.pipeline.run import run_scene

SCENES = 8
SETTINGS = {"voxel": 0.0125, "step": 0.025, "yaw_step": 4}
EMPTY_TASKS = 2000
BANDWIDTH = 1e9  # bytes a second, of the shared storage of a cluster: a file server on a line of 10 Gbit


def write_scenes(folder: Path) -> list[Path]:
    """Eight cuts of the demo, each of other frames, and one more to warm workers up with."""
    content = tomllib.loads((BUNDLED / "demo.toml").read_text())
    files = []
    for i in range(SCENES + 1):
        early, late = i % 3, i // 3
        segments = [
            {
                **segment,
                "frames": {who: [first + early, last - late] for who, (first, last) in segment["frames"].items()},
            }
            for segment in content["segments"]
        ]
        cut = {**content, "name": f"cut-{i}", "segments": segments, "search": SETTINGS}
        files.append(folder / f"cut-{i}.toml")
        files[-1].write_text(tomlkit.dumps(moved_content(cut, BUNDLED, folder)))
    return files


def measure(files: Sequence[Path], folder: Path, workers: int) -> Measured:
    """Solve the scenes on some workers, without the check on the meshes and the reports on it."""
    *scenes, other = files
    out, began = folder / f"out-{workers}", time.perf_counter()
    with connected(None, workers=workers, memory=None, folder=folder) as client:
        start = time.perf_counter() - began
        _hold_to_cores(client)
        client.run(_warm_up, other, folder)
        before = _bytes(client)
        with get_task_stream(client, plot=False) as stream:
            began = time.perf_counter()
            done = run_batch(
                asked_scenes(scenes, out), out, options=Options(scheduler=client.scheduler.address, check=False)
            )
            seconds = time.perf_counter() - began
        after, peak = _bytes(client), max(client.run(_peak_mb).values())
        empty = _empty_task(client)
    assert all(scene.verdict == "done" for scene in done), done
    tasks: dict[str, list[float]] = {}
    for task in stream.data:
        spent = sum(part["stop"] - part["start"] for part in task["startstops"] if part["action"] == "compute")
        tasks.setdefault(task["key"].partition("-")[0], []).append(spent)
    count = len(stream.data)
    return Measured(
        workers=workers,
        seconds=seconds,
        start=start,
        tasks=tasks,
        peak_mb=peak,
        read=(after[0] - before[0]) / count,
        written=(after[1] - before[1]) / count,
        moved=sum(task["nbytes"] for task in stream.data) / count,
        empty=empty,
    )


def _hold_to_cores(client: Client) -> None:
    cores = sorted(os.sched_getaffinity(0))
    for i, worker in enumerate(client.nthreads()):
        client.run(os.sched_setaffinity, 0, {cores[i % len(cores)]}, workers=[worker])


def _warm_up(scene: Path, folder: Path) -> None:
    """Let a worker import and compile everything."""
    run_scene(scene, folder / f"warm-{os.getpid()}", workers=1, check=False)


def _bytes(client: Client) -> tuple[int, int]:
    """Read and written by all workers so far."""
    told = client.run(lambda: dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines()))
    return sum(int(own["rchar"]) for own in told.values()), sum(int(own["wchar"]) for own in told.values())


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _empty_task(client: Client) -> float:
    """Seconds that a task takes that does nothing: what the scheduler has to do with it, at most."""
    began = time.perf_counter()
    client.gather(client.map(lambda number: None, range(EMPTY_TASKS), pure=False))
    return (time.perf_counter() - began) / EMPTY_TASKS


def main() -> None:
    """Measure, model, and print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write docs/scaling.md and its picture")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = write_scenes(folder)
        one, two = (measure(files, folder, workers) for workers in (1, 2))
    shared = Machinery(per_task=one.empty, bandwidth=BANDWIDTH)
    print(json.dumps([asdict(one), asdict(two)], indent=1))
    print(f"two workers: {one.seconds / two.seconds:.2f} times as fast")
    print("\n".join(predicted(scenes_of(one), shared)))
    if asked.write:
        write_page(one, two, shared, machine=machine())


if __name__ == "__main__":
    main()
