"""The cache as a whole: how large it may grow, what goes first, and the command."""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mhvedit.pipeline.kept import GB, VARIABLE, entries_in, trim
from mhvedit.pipeline.packing import packed, unpacked
from mhvedit.pipeline.run import Outcome, run_scene
from mhvedit.sequences.contents import contents
from tests.pipeline.toy import Ran, files_of, write_scene

Command = Callable[..., Ran]


AGES = {"contact/a": 500, "frames/b": 400, "group/c": 300, "contact/d": 200, "contact/e": 0}  # s


def fill(out: Path) -> list[Path]:
    """Entries of a kilobyte."""
    files = [out / ".cache" / ("" if "frames" in name else "results") / f"{name}.npz" for name in AGES]
    for file, age in zip(files, AGES.values(), strict=True):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(bytes(1000))
        os.utime(file, (time.time() - age,) * 2)
    return files


@pytest.mark.parametrize(
    ("kilobytes", "left"), [(9, "abcde"), (5, "abcde"), (4.5, "bcde"), (3, "bde"), (2, "be"), (1, "e"), (0, "e")]
)
def test_what_was_not_used_for_longest_goes_first(tmp_path: Path, kilobytes: float, left: str) -> None:
    """Converted frames after everything else; what this run used stays, whatever the limit."""
    files = fill(tmp_path)
    freed = trim(tmp_path, limit=kilobytes * 1000 / GB, since=time.time() - 10)
    assert "".join(file.stem for file in files if file.exists()) == left
    assert freed == 1000 * (5 - len(left))


def test_reading_counts_as_use(folder: Path, unmeasured: None) -> None:
    out = folder / "out"
    run_scene(folder / "scene.toml", out, report=False)
    for entry in entries_in(out):
        os.utime(entry.file, (1, 1))
    run_scene(folder / "scene.toml", out, report=False, cache_gb=0)
    left = {entry.stage for entry in entries_in(out)}
    assert {"group", "centres", "plan"} <= left and not left & {"contact", "bodies", "volumes", "sight"}


def test_a_run_with_the_smallest_cache(folder: Path, unmeasured: None, searches: list[int]) -> None:
    """Says the same, and the next change costs more."""
    out = folder / "out"
    run_scene(folder / "scene.toml", out, report=False)
    before = files_of(out)["edit.json"]
    for _ in range(2):
        for entry in entries_in(out):
            os.utime(entry.file, (1, 1))
        run_scene(
            write_scene(folder, ("[search]", "[optimise]\nalpha = 9.0\n\n[search]")), out, report=False, cache_gb=0
        )
    run_scene(write_scene(folder), out, report=False, cache_gb=0)
    assert files_of(out)["edit.json"] == before


@pytest.mark.parametrize("told", ["much", "-1", "nan"])
def test_a_limit_that_is_none(mhvedit: Command, folder: Path, monkeypatch: pytest.MonkeyPatch, told: str) -> None:
    monkeypatch.setenv(VARIABLE, told)
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--answer-only")
    assert (ran.code, ran.sentence) == (2, f"{VARIABLE}: expected a number of GB, 0 or more, found {told!r}")
    assert not (folder / "out").exists()


def test_the_command(mhvedit: Command, folder: Path, unmeasured: None, searches: list[int]) -> None:
    out = folder / "out"
    run_scene(folder / "scene.toml", out, report=False)
    before = files_of(out)
    shown = mhvedit("cache", "show", out)
    stages = [line.split()[0] for line in shown.out.splitlines()[:-1]]
    assert shown.code == 0 and {"contact", "bodies", "group", "volumes", "frames"} <= set(stages)
    assert shown.out.splitlines()[-1].endswith(" of at most 8 GB")
    told = json.loads(mhvedit("cache", "show", out, "--json").out)
    assert told["size"] == sum(stage["size"] for stage in told["stages"]) > 0
    cleared = mhvedit("cache", "clear", out)
    assert cleared.code == 0 and cleared.out.endswith(" freed\n")
    assert entries_in(out) == [] and files_of(out) == before
    searches.clear()
    assert not run_scene(folder / "scene.toml", out, report=False).redone and len(searches) == 2


@pytest.mark.parametrize("word", ["show", "clear"])
def test_the_command_elsewhere(mhvedit: Command, tmp_path: Path, word: str) -> None:
    ran = mhvedit("cache", word, tmp_path)
    assert ran.sentence == f"{tmp_path}: expected an output folder of `mhvedit solve`, found another"
    assert mhvedit("cache", word, tmp_path / "no").sentence.endswith("found nothing") and ran.code == 2
    assert list(tmp_path.iterdir()) == []


def test_contents_are_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a file has been left alone for a while: within a tick of the clock it may change without a trace."""
    file, memory = tmp_path / "a.obj", tmp_path / "memory" / "contents.json"
    file.write_text("v 0 0 0")
    fresh = contents(memory)
    name = fresh.of([file])
    fresh.save()
    assert not memory.exists()
    monkeypatch.setattr(time, "time_ns", lambda: file.stat().st_ctime_ns + 3_000_000_000)
    settled = contents(memory)
    assert settled.of([file]) == name
    settled.save()
    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", None)
        assert contents(memory).of([file]) == name
    file.write_text("v 1 0 0")
    assert contents(memory).of([file]) != name
    memory.write_text("{")
    assert contents(memory).known == {}


@pytest.mark.parametrize("name", ["raise", "lower"])
def test_volumes_come_back(solved: tuple[Path, Outcome], name: str) -> None:
    for volumes in solved[1].result.segment(name).volumes():
        back = unpacked(packed(volumes))
        assert back.solids.keys() == volumes.solids.keys() and back.parts.keys() == volumes.parts.keys()
        for key, part in volumes.parts.items():
            own = back.parts[key]
            assert own.solid == part.solid and own.volume.grid == part.volume.grid
            assert own.volume.n_frames == part.volume.n_frames
            np.testing.assert_array_equal(own.volume.frames, part.volume.frames)
