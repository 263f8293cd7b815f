"""Runs a program in a process of its own, and says how long it took and how much memory it had."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
COMMAND = Path(sys.executable).with_name("mhvedit")


@dataclass(frozen=True, slots=True)
class Ran:
    """A program that ended well."""

    seconds: float
    peak_mb: float  # the most memory that it had
    output: str

    @property
    def figures(self) -> dict[str, Any]:
        """Its output, read as JSON."""
        found: dict[str, Any] = json.loads(self.output)
        return found


def run(*command: str | Path, env: Mapping[str, str] | None = None) -> Ran:
    """Run a program from the project's folder, as users do whose modules are compiled to bytecode already.

    Args:
        command: the program and its arguments.
        env: what its environment has more than this one.

    Raises:
        CalledProcessError: it ended with an error.
    """
    around = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | dict(env or {})
    os.sync()  # what others have left to be written would be in its way
    began = time.perf_counter()
    with subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.PIPE, cwd=ROOT, env=around, text=True
    ) as process:
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, process.args, output)
    return Ran(time.perf_counter() - began, usage.ru_maxrss / 1024, output)


def measured(module: str, *arguments: str | Path) -> Ran:
    """Run one of the benchmarks' modules."""
    return run(sys.executable, "-m", f"benchmarks.{module}", *arguments)


def solve(scene: Path, out: Path, *options: str) -> Ran:
    """Run `mhvedit solve`; it prints its report."""
    return run(COMMAND, "solve", scene, "-o", out, "--json", *options)
