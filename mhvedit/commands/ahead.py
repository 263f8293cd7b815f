"""A first run compiles its kernels, which takes longer than its work: a second process compiles some of them meanwhile.

numba keeps what it compiles there, and the work finds it when it gets there.
"""

import atexit
import os
import subprocess
import sys
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from mhvedit.optimise.bounds import bound_branches
from mhvedit.search.meet import search_shifts


def compile_ahead() -> None:
    """Start the second process, where what takes longest is not kept yet and there is a processor for it.

    It ends with this one at the latest. Nothing depends on it.
    """
    longest = search_shifts, bound_branches  # to compile
    if (os.cpu_count() or 1) < 2 or all(map(_is_kept, longest)):
        return
    helper = subprocess.Popen(
        [sys.executable, "-P", "-c", "from mhvedit.commands.examples import main; main()"],
        stdin=subprocess.PIPE,  # never written to: it closes when this process ends
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(helper.kill)  # and is held on to until then


def _is_kept(kernel: Dispatcher) -> bool:
    """Whether numba keeps a kernel, as its source is now."""
    source, folder = Path(kernel.py_func.__code__.co_filename), kernel.stats.cache_path
    assert folder is not None  # which says that a kernel is not to be kept
    indices = Path(folder).glob(f"{source.stem}.{kernel.py_func.__name__}-*.nbi")
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)
