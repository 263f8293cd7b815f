"""A batch from beginning to end: what stands is left alone, the rest is handed to workers."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final
from uuid import uuid4
from weakref import WeakValueDictionary

from mhvedit.batch.asked import AskedScene
from mhvedit.batch.cluster import ANSWERS_IN, RETURNS_IN, Client, connected, dashboard_of, thread_count
from mhvedit.batch.desk import NOBODY, Desk, Step, Told, is_bad, is_finished, is_varied, next_step, variants_key
from mhvedit.batch.plan import scene_tasks
from mhvedit.batch.records import Inputs
from mhvedit.batch.report import write_summary
from mhvedit.batch.tasks import SceneDone, finish_scene, look_at, solve_one, vary
from mhvedit.errors import MhveditError
from mhvedit.pipeline.kept import cache_limit, trim
from mhvedit.pipeline.output import CACHE, claimed
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import SceneFile
from mhvedit.sequences.contents import contents

AHEAD: Final = 3  # scenes a thread that are handed in, so that nobody waits for work
LEAST_AHEAD: Final = 8
TRIMMED_EVERY: Final = 30.0  # s
CONNECTIONS: Final = 3  # times that a scheduler is looked for, the first among them
LOST: Final = ("cancelled", "lost")  # states of futures whose scheduler went away
Future = Any  # of an untyped library


@dataclass(frozen=True, slots=True)
class Options:
    """How a batch is done; what the scenes come to depends on the last two alone."""

    workers: int = 2  # processes on this machine
    scheduler: str | None = None  # address; None: a cluster on this machine
    memory: float | None = None  # GB for each worker on this machine; None: an equal share
    cache: float | None = None  # GB that the cache may take; None: what the environment says, or else 8
    check: bool = True  # the answers on the meshes
    report: bool = True  # drawn of each scene


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """What was handed in over one connection."""

    client: Client
    name: str = field(default_factory=lambda: uuid4().hex)  # so that a scheduler takes no task for one of another run
    ended: "SimpleQueue[Future]" = field(default_factory=SimpleQueue)
    under_way: dict[Future, tuple[Step, float]] = field(default_factory=dict)  # with the time, s since 1970
    needed: dict[Future, list[Future]] = field(default_factory=dict)  # what a step that is under way waits for
    shared: "WeakValueDictionary[str, Future]" = field(default_factory=WeakValueDictionary)  # of tasks, by key
    order: Iterator[int] = field(default_factory=count)  # of steps


class SchedulerLost(MhveditError, RuntimeError):
    """The scheduler went away in the middle of a batch."""

    def __init__(self, folder: Path) -> None:
        super().__init__(f"{folder}: expected a scheduler to the end, found none any more; the next run goes on")


def run_batch(
    asked: Sequence[AskedScene],
    out: Path,
    *,
    options: Options | None = None,
    told: Told = NOBODY,
    watch: Callable[[str], None] | None = None,
) -> tuple[SceneDone, ...]:
    """Finish scenes; those that an earlier run finished, and whose inputs did not change since, are left as they are.

    `summary.json` and `index.html` are written however the run ends.

    Args:
        asked: the scenes.
        out: output folder of the batch; a scene's is in it under its name.
        options: how.
        told: told of every scene as soon as it is finished.
        watch: told where the dashboard is.

    Raises:
        ClusterError: there is no such cluster.
        MissingLibrary: distributed is not installed.
        OutputBusy: another run is writing to `out`.
        SchedulerLost: the scheduler went away, and did not come back.
    """
    options = options or Options()
    out = out.absolute()
    with claimed(out):
        (out / CACHE).mkdir(exist_ok=True)
        _sweep(out)
        desk = Desk(
            out=out,
            waiting=iter(asked),
            inputs=Inputs(contents(out / CACHE / "contents.json")),
            check=options.check,
            report=options.report,
            told=told,
            known=[scene.name for scene in asked],
        )
        try:
            _work(desk, options, watch)
        finally:
            desk.inputs.contents.save()
            write_summary(out, desk.found, missing=[name for name in desk.known if name not in desk.done])
        trim(out, limit=_limit(options), since=time.time())
    return desk.found


def solve_segments(scene: Path, out: Path, *, scheduler: str) -> None:
    """Have a cluster solve the segments of one scene, into the cache of its output folder; the rest is left to do.

    Args:
        scene: the scene file.
        out: output folder of the scene.
        scheduler: address.

    Raises:
        ClusterError: there is no such cluster.
        MissingLibrary: distributed is not installed.
        OutputBusy: another run is writing to `out`.
        SceneError: something is wrong with the scene file.
        SchedulerLost: the scheduler went away.
    """
    told, out = load_scene(scene), out.absolute()
    with claimed(out), connected(scheduler, workers=0, memory=None, folder=out) as client:
        session = Session(client)
        futures = _needs(told, out / CACHE, session, priority=0)
        for future in futures:
            future.add_done_callback(session.ended.put)
        if any(session.ended.get().status in LOST for _ in futures):
            raise SchedulerLost(out)


def _work(desk: Desk, options: Options, watch: Callable[[str], None] | None) -> None:
    """Do what does not stand; where nothing is left to do, no cluster is even looked for."""
    there, memory, workers = options.scheduler, options.memory, options.workers
    for patience in (ANSWERS_IN, *[RETURNS_IN] * (CONNECTIONS - 1)):
        first = next_step(desk)
        if first is None:
            return
        desk.steps.appendleft(first)
        with connected(there, workers=workers, memory=memory, folder=desk.out, patience=patience) as client:
            if watch is not None and (place := dashboard_of(client)) is not None:
                watch(place)
            if _keep_busy(desk, Session(client), limit=_limit(options)):
                return
    raise SchedulerLost(desk.out)


def _keep_busy(desk: Desk, session: Session, *, limit: float) -> bool:
    """Hand in and collect until all is done.

    Returns:
        Whether it is; if not, the scheduler went away, and what was under way is back on the desk.
    """
    trimmed = time.monotonic()
    while True:
        _hand_in(desk, session)
        if not session.under_way:
            return True
        future = session.ended.get()
        if future.status in LOST:
            desk.steps.extendleft(step for step, _ in reversed(session.under_way.values()))
            return False
        step, _ = session.under_way.pop(future)
        session.needed.pop(future)
        _collect(desk, step, future)
        if time.monotonic() > trimmed + TRIMMED_EVERY:
            trim(desk.out, limit=limit, since=min((at for _, at in session.under_way.values()), default=time.time()))
            trimmed = time.monotonic()


def _hand_in(desk: Desk, session: Session) -> None:
    """Give the workers enough to do; not all at once: a scheduler has better to do than to hold 10,000 scenes."""
    enough = max(LEAST_AHEAD, AHEAD * thread_count(session.client))
    while len(session.under_way) < enough and (step := next_step(desk)) is not None:
        future, needs = _submitted(desk, step, session)
        session.under_way[future] = step, time.time()
        session.needed[future] = needs
        future.add_done_callback(session.ended.put)


def _submitted(desk: Desk, step: Step, session: Session) -> tuple[Future, list[Future]]:
    """The future of a step, and those of what it needs; scenes are worked on in their order."""
    name, file = step.asked.name, step.scene.file.absolute()
    submit, priority = session.client.submit, -next(session.order)
    if step.done is not None:
        solutions, under = step.asked.solutions, variants_key(step)
        key = f"vary-{name}-{session.name}"
        return submit(vary, file, desk.out, step.done, solutions, under=under, key=key, priority=priority), []
    needs = [] if step.kept else _needs(step.scene, desk.out / CACHE, session, priority=priority)
    future = submit(
        finish_scene,
        name,
        file,
        desk.out,
        *needs,
        under=step.key,
        check=desk.check,
        report=desk.report,
        key=f"finish-{name}-{session.name}",
        priority=priority,
    )
    return future, needs


def _needs(scene: SceneFile, cache: Path, session: Session, *, priority: int) -> list[Future]:
    """Futures of the tasks of a scene; those that another scene has handed in are taken from there."""
    file = scene.file.absolute()
    found: dict[str, Future] = {}
    for task in scene_tasks(scene):
        future = session.shared.get(task.key)
        if future is None:
            work, needs = (solve_one if task.needs else look_at), [found[key] for key in task.needs]
            key = f"{task.key}-{session.name}"
            future = session.client.submit(work, file, cache, task.name, *needs, key=key, priority=priority)
            session.shared[task.key] = future
        found[task.key] = future
    return list(found.values())


def _collect(desk: Desk, step: Step, future: Future) -> None:
    """Take what came of a step."""
    fault = future.exception()
    if fault is not None:
        is_bad(desk, step, _said(fault, step))
    elif step.done is None:
        is_finished(desk, step, future.result())
    else:
        is_varied(desk, step, future.result())


def _said(fault: BaseException, step: Step) -> str:
    """Why a worker did not come back with anything; what our own code raises comes back as a result."""
    if type(fault).__name__ == "KilledWorker":
        found = "none: each died over it (out of memory? `--memory`, or enlarge search.voxel or search.step)"
        return f"{step.scene.file}: expected a worker that lives to finish it, found {found}"
    return f"{step.scene.file}: expected an answer, found {type(fault).__name__}: {' '.join(str(fault).split())}"


def _sweep(out: Path) -> None:
    """Take away what workers that were killed had begun to write."""
    for part in (out / CACHE).rglob(".*.part"):
        part.unlink(missing_ok=True)


def _limit(options: Options) -> float:
    """GB that the cache may take."""
    return cache_limit() if options.cache is None else options.cache
