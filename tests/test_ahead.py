"""The second process of a first run."""

import importlib.util
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from mhvedit.commands import ahead, examples
from mhvedit.search.meet import search_shifts
from tests.pipeline.toy import ANNA, BEN, write_actor, write_scene

RUN_AND_COMPILE = """
import sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from mhvedit.pipeline.run import run_scene

def signatures():
    modules = [module for name, module in sys.modules.items() if name.startswith("mhvedit.")]
    kernels = {id(own): own for module in modules for own in vars(module).values() if isinstance(own, Dispatcher)}
    return {(own.__name__, signature) for own in kernels.values() for signature in own.signatures}

for scene in map(Path, sys.argv[1:]):
    run_scene(scene, scene.parent / "out")
needed = signatures()
from mhvedit.commands.examples import compile_examples
compile_examples()
for name, signature in signatures() - needed:
    print(name, signature)
"""

KERNELS = """
from numba import njit

@njit(cache=True)
def look(x):
    return x + 1

@njit(cache=True)
def look_again(x):
    return x + 2
"""


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Command lines of the processes that are asked for, none of which is started."""
    asked: list[list[str]] = []

    class Helper:
        def __init__(self, words: list[str], **rest: object) -> None:
            asked.append(words)

        def kill(self) -> None: ...

    monkeypatch.setattr(subprocess, "Popen", Helper)
    return asked


def test_examples_compile_nothing_but_what_the_work_needs(tmp_path: Path) -> None:
    """Neither in a scene of many solutions, nor in one in which no placement serves all segments."""
    scenes = []
    for name, anna, yaw_step in (("many", ANNA, 1), ("none", replace(ANNA, left_from=8), 15)):
        folder = tmp_path / name
        folder.mkdir()
        write_actor(folder, "anna", anna)
        write_actor(folder, "ben", BEN)
        scenes.append(write_scene(folder, ("yaw_step = 15", f"yaw_step = {yaw_step}")))
    ran = subprocess.run([sys.executable, "-c", RUN_AND_COMPILE, *scenes], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout) == (0, ""), ran.stderr


def test_nothing_is_compiled_ahead_that_is_kept(started: list[list[str]]) -> None:
    for example in examples.EXAMPLES:
        example()
    ahead.compile_ahead()
    assert not started


def test_what_is_not_kept_is_compiled_ahead_where_there_is_a_processor_for_it(
    started: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ahead, "_is_kept", lambda kernel: kernel is not search_shifts)
    for processors in (2, 1, None):
        monkeypatch.setattr(os, "cpu_count", lambda found=processors: found)
        ahead.compile_ahead()
    assert [words[0] for words in started] == [sys.executable]


def test_a_kernel_is_kept_as_its_source_is_now(tmp_path: Path) -> None:
    source = tmp_path / "kernels.py"
    source.write_text(KERNELS)
    spec = importlib.util.spec_from_file_location("kernels", source)
    assert spec is not None and spec.loader is not None
    kernels = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(kernels)
    kernels.look_again(1)
    assert not ahead._is_kept(kernels.look)
    kernels.look(1)
    assert ahead._is_kept(kernels.look)
    later = source.stat().st_mtime + 60
    os.utime(source, (later, later))
    assert not ahead._is_kept(kernels.look)


def test_the_second_process_ends_with_the_first() -> None:
    """Whose end of the pipe closes, however it ends."""
    endless = "import time; from mhvedit.commands import examples; examples.EXAMPLES = (lambda: time.sleep(600),)"
    ran = subprocess.run([sys.executable, "-c", f"{endless}; examples.main()"], stdin=subprocess.DEVNULL, timeout=60)
    assert ran.returncode == 0
