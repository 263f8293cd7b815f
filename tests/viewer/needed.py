"""Programs that some tests drive: where one is missing they are left out, but not in continuous integration."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

APT = "apt-get install chromium xvfb"


def program(*names: str) -> str:
    """The path of a program, by any of its names."""
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is not None:
        return found
    sentence = f"{names[0]} is not installed; on Debian: {APT}"
    if os.environ.get("CI"):
        pytest.fail(sentence)
    pytest.skip(sentence)


@contextmanager
def screen() -> Iterator[str]:
    """The name of a display of 1280 x 800 of its own.

    The server picks a free number and tells it once it answers. It outlives its clients (`-noreset`): VTK looks
    whether there is a display before it opens one, and a server that starts anew when its last client leaves
    refuses, now and then, the second connection.
    """
    ready, told = os.pipe()
    command = [program("Xvfb"), "-displayfd", str(told), "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(command, pass_fds=[told], stderr=subprocess.DEVNULL) as server, open(ready) as answer:
        os.close(told)
        try:
            yield f":{int(answer.readline())}"
        finally:
            server.terminate()


def ran_on_screen(script: Path, *arguments: Path) -> subprocess.CompletedProcess[str]:
    """A Python script, run to its end with a display of its own."""
    with screen() as display:
        return subprocess.run(
            [sys.executable, script, *arguments],
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, "DISPLAY": display},
            check=False,
        )
