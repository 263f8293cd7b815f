"""A first run compiles its kernels, which takes longer than its work: a second process compiles some of them meanwhile.

numba keeps what it compiles there, and the work finds it when it gets there.
"""

import atexit
import os
import subprocess
import sys
from pathlib import Path

from mhvedit.search import meet


def compile_ahead() -> None:
    """Start the second process, where nothing is compiled yet and there is a processor for it.

    It ends with this one at the latest. Nothing depends on it.
    """
    longest = meet.search_shifts  # to compile
    if (os.cpu_count() or 1) < 2 or _is_kept(Path(meet.__file__), longest.__name__, Path(longest.stats.cache_path)):
        return
    helper = subprocess.Popen(
        [sys.executable, "-c", "from mhvedit.commands.examples import compile_examples; compile_examples()"],
        cwd=Path(__file__).parents[2],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(helper.kill)


def _is_kept(source: Path, kernel: str, folder: Path) -> bool:
    """Whether numba keeps a kernel in a folder, as its source is now."""
    written = source.stat().st_mtime
    return any(index.stat().st_mtime >= written for index in folder.glob(f"{source.stem}.{kernel}-*.nbi"))
