"""Dask's scheduler and workers: on this machine for as long as a batch takes, or wherever an address leads."""

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, Final

from mhvedit.errors import MhveditError, MissingLibrary

HERE: Final = "127.0.0.1"
SHARE: Final = 0.8  # of the machine's memory that local workers have together
GB: Final = 1e9
ANSWERS_IN: Final = 5.0  # s, a scheduler that is there
RETURNS_IN: Final = 60.0  # s, one that is started again
LOGGERS: Final = ("distributed", "tornado", "bokeh", "asyncio")
PINNED: Final = {"NUMBA_NUM_THREADS": 1, "DASK_LOGGING__DISTRIBUTED": "critical"}
SETTINGS: Final = {
    # results of tasks are small: what takes memory is a task at work, which neither spilling nor a pause would help
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
}
Client = Any  # of an untyped library


class ClusterError(MhveditError, RuntimeError):
    """A cluster cannot be used."""

    def __init__(self, address: str, expected: str, found: str) -> None:
        super().__init__(f"--scheduler {address}: expected {expected}, found {found}")
        self.address = address


def distributed() -> Any:  # noqa: ANN401 - module of an untyped library
    """The library.

    Raises:
        MissingLibrary: it is not installed.
    """
    try:
        import distributed
    except ImportError as error:
        raise MissingLibrary("a batch", "pip install 'mhvedit[cluster]'") from error
    return distributed


@contextmanager
def connected(
    address: str | None, *, workers: int, memory: float | None, folder: Path, patience: float = ANSWERS_IN
) -> Iterator[Client]:
    """A client of a cluster.

    Args:
        address: of a scheduler; None for one on this machine that ends with the block.
        workers: processes on this machine, of one thread each.
        memory: GB for each of these; a task that takes more costs its scene. None: an equal share of most of it.
        folder: that all workers must be able to write into.
        patience: s, for the scheduler at an address to answer.

    Raises:
        ClusterError: no scheduler there, or its workers cannot be used.
        MissingLibrary: distributed is not installed.
    """
    library = distributed()
    with _quiet():
        if address is None:
            with _local(library, workers, memory) as cluster, library.Client(cluster) as client:
                yield client
            return
        try:
            client = library.Client(address, timeout=patience)
        except (OSError, ValueError) as error:
            raise ClusterError(address, "a Dask scheduler", "nothing that answers") from error
        with client:
            _check_workers(client, address, folder, patience)
            yield client


def thread_count(client: Client) -> int:
    """How many tasks the workers do at once; at least one is expected to come."""
    return max(1, sum(map(int, client.nthreads().values())))


def dashboard_of(client: Client) -> str | None:
    """Where Dask's dashboard is; None where the scheduler shows none."""
    return str(client.dashboard_link) if "dashboard" in client.scheduler_info()["services"] else None


def default_memory(workers: int) -> float:
    """GB for each of some workers on this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") * SHARE / workers / GB


@contextmanager
def _local(library: Any, workers: int, memory: float | None) -> Iterator[Any]:  # noqa: ANN401
    """A scheduler and workers on this machine."""
    from dask import config

    environment = {**config.get("distributed.nanny.pre-spawn-environ"), **PINNED}
    with config.set({**SETTINGS, "distributed.nanny.pre-spawn-environ": environment}):
        with _interrupts_held_back():
            cluster = library.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=HERE,
                dashboard_address=f"{HERE}:0",
                worker_dashboard_address=None,
                memory_limit=int((default_memory(workers) if memory is None else memory) * GB),
                silence_logs=logging.CRITICAL,
            )
        with cluster:
            yield cluster


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Threads that start here, and processes that these start, never hear of Ctrl-C; this one does, afterwards."""
    resource_tracker.ensure_running()  # it would let interrupts through again if it were started by these
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check_workers(client: Client, address: str, folder: Path, patience: float) -> None:
    """Refuse a cluster without workers, and workers that would do it wrong."""
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError:
        raise ClusterError(address, "a worker or more", "none") from None
    crowded = {worker for worker, threads in client.nthreads().items() if threads > 1}
    if crowded:
        expected = "workers of one thread (`dask worker --nthreads 1`)"
        raise ClusterError(address, expected, f"{len(crowded)} of more, one at {min(crowded)}")
    blind = {worker for worker, sees in client.run(os.access, folder, os.W_OK).items() if not sees}
    if blind:
        raise ClusterError(address, f"workers that can write to {folder}", f"one that cannot, at {min(blind)}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask's own words stay away from people; what matters to them is said elsewhere."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in LOGGERS]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
