"""A run that ends early - Ctrl-C, a full disk, a second run on the same folder - leaves nothing half-written."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import NO_CONTACT
from mhvedit.pipeline import output, stages
from mhvedit.pipeline.output import claimed
from tests.pipeline.toy import Ran, files_of, write_scene

pytestmark = pytest.mark.usefixtures("unmeasured")
Command = Callable[..., Ran]


@pytest.fixture
def solve(mhvedit: Command, folder: Path) -> Callable[[], Ran]:
    return lambda: mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")


def leftovers(out: Path) -> list[str]:
    return [p.name for p in out.rglob("*") if p.name.endswith((".part", ".tmp")) or p.name == ".new"]


@contextmanager
def fails_at(monkeypatch: pytest.MonkeyPatch, count: int, error: BaseException) -> Iterator[None]:
    """The search of one segment ends with an error."""
    search, made = stages.__dict__["search_poses"], [0]

    def failing(grid: object, clauses: Sequence[Clause], **options: object) -> object:
        made[0] += bool(clauses) and clauses[0].reason == NO_CONTACT
        if made[0] == count:
            raise error
        return search(grid, clauses, **options)

    with monkeypatch.context() as patch:
        patch.setattr(stages, "search_poses", failing)
        yield


def test_ctrl_c_halfway(
    solve: Callable[[], Ran],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    searches: list[int],
    solved: tuple[Path, object],
) -> None:
    with fails_at(monkeypatch, 2, KeyboardInterrupt()):
        ran = solve()
    assert (ran.code, ran.sentence) == (130, "interrupted; the next run goes on from here")
    assert files_of(folder / "out") == {} and not leftovers(folder / "out")
    assert len(searches) == 1
    assert solve().code == 0
    assert len(searches) == 2, "the first segment is not searched again"
    assert files_of(folder / "out")["edit.json"] == files_of(solved[0])["edit.json"]


def test_ctrl_c_over_an_earlier_answer(solve: Callable[[], Ran], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solve()
    before = files_of(folder / "out")
    write_scene(folder, ("window = 2.4", "window = 2.6"))
    with fails_at(monkeypatch, 2, KeyboardInterrupt()):
        assert solve().code == 130
    assert files_of(folder / "out") == before


def test_a_real_signal(captures: Path, tmp_path: Path) -> None:
    """SIGINT to the process itself, in the middle of a fine search."""
    fine = "voxel = 0.01\nstep = 0.01\nyaw_step = 0.2"
    scene = write_scene(tmp_path, ("voxel = 0.04\nstep = 0.04\nyaw_step = 15", fine))
    for name in ("anna", "ben"):
        (tmp_path / name).symlink_to(captures / name)
        (tmp_path / f"{name}.csv").symlink_to(captures / f"{name}.csv")
    words = [sys.executable, "-m", "mhvedit.cli", "solve", str(scene), "-o", str(tmp_path / "out")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as job:
        deadline = time.monotonic() + 30
        while not list((tmp_path / "out").rglob("results/*/*.npz")) and time.monotonic() < deadline:
            time.sleep(0.02)
        job.send_signal(signal.SIGINT)
        out, err = job.communicate(timeout=30)
    assert (job.returncode, out) == (130, ""), err
    assert err == "mhvedit: interrupted; the next run goes on from here\n"
    assert files_of(tmp_path / "out") == {} and not leftovers(tmp_path / "out")


@pytest.mark.parametrize("place", ["replace", "savez", "search"])
def test_a_full_disk(
    solve: Callable[[], Ran], folder: Path, monkeypatch: pytest.MonkeyPatch, searches: list[int], place: str
) -> None:
    """However it shows: when a file is renamed, while one is written, or in the middle of the job."""
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def fail(*args: object, **options: object) -> None:
        raise full

    with monkeypatch.context() as patch:
        if place == "replace":
            patch.setattr(os, "replace", fail)
        elif place == "savez":
            patch.setattr(output, "write_json", fail)
        with fails_at(monkeypatch, 2 if place == "search" else 99, full):
            ran = solve()
    assert ran.code == 2
    out = folder / "out"
    expected = "expected a file or folder that can be read and written, found: No space left on device"
    assert ran.err.splitlines()[-1] == f"mhvedit: {out}: {expected}"
    assert files_of(out) == {} and not leftovers(out)
    before = len(searches)
    assert solve().code == 0
    assert len(searches) - before == {"replace": 2, "savez": 0, "search": 1}[place]
    assert "edit.json" in files_of(out)


@pytest.mark.parametrize("limit", [2_000, 6_000, 20_000])
def test_files_that_may_not_grow(solve: Callable[[], Ran], folder: Path, limit: int) -> None:
    """The system itself ends a write in the middle: at a limit on the size of a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        ran = solve()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    out = folder / "out"
    assert ran.code == 2 and ran.err.endswith("found: File too large\n"), ran.err
    assert files_of(out) == {} and not leftovers(out)
    assert solve().code == 0
    with np.load(out / "solutions" / "raise.npz") as kept:
        assert len(kept["x"])


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")
def test_a_small_disk(mhvedit: Command, folder: Path) -> None:
    """A real one, that is really full."""
    out = folder / "out"
    out.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", out], capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    try:
        ran = mhvedit("solve", folder / "scene.toml", "-o", out, "--no-report")
        assert ran.code == 2
        assert ran.err.splitlines()[-1].startswith(f"mhvedit: {out}") and "No space left on device" in ran.err
        assert files_of(out) == {} and not leftovers(out)
        subprocess.run(["mount", "-o", "remount,size=10m", out], check=True)
        assert mhvedit("solve", folder / "scene.toml", "-o", out, "--no-report").code == 0
        assert "edit.json" in files_of(out)
    finally:
        subprocess.run(["umount", out], check=True)


def test_two_runs_at_once(solve: Callable[[], Ran], folder: Path) -> None:
    with claimed(folder / "out"):
        ran = solve()
    assert ran.code == 2
    expected = "expected an output folder that no other run is using, found process"
    assert ran.sentence == f"{folder / 'out'}: {expected} {os.getpid()} at work there"
    assert files_of(folder / "out") == {}
    assert solve().code == 0


@pytest.mark.parametrize("inside", [False, True])
def test_the_output_folder_is_a_file(mhvedit: Command, folder: Path, inside: bool) -> None:
    (folder / "out").write_text("mine")
    out = folder / "out" / "deeper" if inside else folder / "out"
    ran = mhvedit("solve", folder / "scene.toml", "-o", out)
    assert ran.code == 2 and ran.sentence == f"{out}: expected a folder that can be written to, found a file"
    assert (folder / "out").read_text() == "mine"


def test_a_read_only_output_folder(solve: Callable[[], Ran], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may write anywhere, so the refusal is played."""
    opened = Path.open

    def refuse(path: Path, *args: object, **options: object) -> object:
        if path.name == ".lock":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opened(path, *args, **options)  # type: ignore[call-overload]

    monkeypatch.setattr(Path, "open", refuse)
    ran = solve()
    assert ran.code == 2
    assert ran.sentence == f"{folder / 'out'}: expected a folder that can be written to, found Permission denied"
    assert files_of(folder / "out") == {}
