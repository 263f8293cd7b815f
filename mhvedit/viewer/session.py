"""A viewer at work: the history of its states, what runs in the background, and what is written on disk."""

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mhvedit.errors import MhveditError, SceneError
from mhvedit.pipeline.job import Job, Result, choose, solve
from mhvedit.pipeline.keys import segment_parts
from mhvedit.pipeline.output import claimed, write_result
from mhvedit.pipeline.picks import idle_exclusions
from mhvedit.pipeline.stages import segment_stages, volumes_of
from mhvedit.project.changes import save_changes
from mhvedit.project.scene_file import load_scene
from mhvedit.viewer.deciding import saved
from mhvedit.viewer.decisions import Decisions, changes_for, decided, decisions_of
from mhvedit.viewer.material import Material, material_of
from mhvedit.viewer.opening import Opened, open_scene
from mhvedit.viewer.scene3d import Volumes
from mhvedit.viewer.state import (
    Change,
    Layer,
    ViewerState,
    advanced,
    changed,
    in_segment,
    redone,
    started,
    undone,
    with_material,
)
from mhvedit.volumes.subject import part_of

MOST_VOLUMES = 3  # segments whose volumes are kept
WORKERS = max(1, os.cpu_count() or 1)


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """What came out of the background."""

    result: Result
    material: Material
    decisions: Decisions


class Session:
    """One viewer's state and its work in the background; knows nothing of windows and browsers.

    Only the thread that made it may call it. What the background finds is taken over in `poll`.
    """

    def __init__(self, opened: Opened, *, workers: int = WORKERS) -> None:
        job = opened.job
        decisions = {} if job is None else decisions_of(job.scene)
        mirrored = frozenset() if job is None else _mirrored(job)
        self.job, self.people, self.out = job, opened.people, opened.out
        self.stale = opened.stale
        self.history = started(opened.material, decisions, mirrored)
        self.message = ""
        self.progress: tuple[str, float] | None = None  # stage in words and share of it, while it solves
        self.workers = workers
        self._result: Result | None = None
        self._volumes: dict[tuple[str, object], Volumes] = {}
        self._pool = ThreadPoolExecutor(1)
        self._solving: Future[Solved] | None = None
        self._measuring: tuple[tuple[str, object], Future[Volumes]] | None = None

    @property
    def state(self) -> ViewerState:
        """What is to be shown."""
        return self.history.now

    @property
    def is_busy(self) -> bool:
        """Whether it solves in the background."""
        return self._solving is not None

    def do(self, change: Change) -> None:
        """Change the state; a decision is followed by a new choice where no search is needed."""
        before = self.state.decisions
        self.history = changed(self.history, change)
        if self.state.decisions != before:
            self._decided()

    def pass_time(self, seconds: float) -> None:
        """Go on playing, if it plays."""
        if self.state.playing:
            self.do(lambda now: advanced(now, seconds))

    def undo(self) -> None:
        """Take the last decision back."""
        self.history = undone(self.history)
        self._decided()

    def redo(self) -> None:
        """Decide again what was taken back."""
        self.history = redone(self.history)
        self._decided()

    def solve(self) -> None:
        """Solve for the present decisions in the background; says so where that cannot be."""
        if self.job is None:
            self.message = "nothing can be solved: " + "; ".join(self.state.material.notes)
        elif self._solving is None:
            job = replace(self.job, scene=decided(self.job.scene, self.state.decisions))
            self.progress = ("starting", 0.0)
            self.message = ""
            self._solving = self._pool.submit(self._solved, job, self._result, self.state.decisions)

    def poll(self) -> bool:
        """Take over what the background has found; whether there was something."""
        return self._take_solved() | self._take_volumes()

    def volumes(self) -> Volumes | None:
        """The current segment's interest parts; begun to be made where they are asked for and not there yet."""
        view, job = self.state.view, self.job
        if view is None or job is None or Layer.VOLUMES not in self.state.layers:
            return None
        key = (view.name, job.scene.search.voxel)
        if key not in self._volumes and self._measuring is None:
            self._measuring = key, self._pool.submit(self._made_volumes, job, view.name)
        return self._volumes.get(key)

    def save(self) -> None:
        """Write the decisions into the scene file, and the answer into the output folder where there is one."""
        if self.job is None:
            self.message = "nothing can be saved: " + "; ".join(self.state.material.notes)
            return
        scene = self.job.scene
        try:
            on_disk = load_scene(scene.file)
            save_changes(scene.file, changes_for(on_disk, scene, self.state.decisions))
            written = [str(scene.file)]
            if self.out is not None and self._result is not None and self.state.is_current:
                with claimed(self.out):
                    write_result(self.out, self._result)
                written.append(str(self.out))
        except (MhveditError, OSError) as fault:
            self.message = f"not saved: {fault}"
            return
        self.history = replace(self.history, now=saved(self.state))
        self.message = f"saved {' and '.join(written)}"

    def close(self) -> None:
        """Wait for nothing, keep nothing."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def finish(self, tell: Callable[[str, float], None] | None = None) -> None:
        """Wait until the background has nothing to do, and take over what it found.

        Args:
            tell: told how far a solve is.
        """
        while self._solving is not None or self._measuring is not None:
            running: list[Future[Any]] = [] if self._solving is None else [self._solving]
            running += [] if self._measuring is None else [self._measuring[1]]
            wait(running, timeout=0.1, return_when=FIRST_COMPLETED)
            if tell is not None and self.progress is not None:
                tell(*self.progress)
            self.poll()

    def go_to_segment(self, name: str) -> None:
        """Make a segment the current one.

        Raises:
            SceneError: there is no such segment.
        """
        known = [span.name for span in self.state.material.spans]
        if name not in known:
            where = "scene" if self.job is None else self.job.scene.file
            raise SceneError(where, "--segment", f"one of {', '.join(known) or 'no segments'}", name)
        self.do(lambda now: in_segment(now, name))

    def go_to_moment(self) -> None:
        """Show the telling moment of the current segment, where there is one."""
        if self.state.segment:
            self.go_to_segment(self.state.segment)

    def _decided(self) -> None:
        """After a decision: choose again at once where a solve has been, and no search is needed for it."""
        if self.state.is_current or self.job is None:
            return
        if not self.state.needs_search:
            self.solve()

    def _solved(self, job: Job, last: Result | None, decisions: Decisions) -> Solved:
        """In the background: choose again, or search where something asks for it."""
        if last is not None and all(
            _searched(decisions, name) == _searched(decisions_of(last.job.scene), name) for name in decisions
        ):
            result = choose(replace(last, job=job), {}, workers=self.workers)
        else:
            result = solve(job, workers=self.workers, progress=self._tell, previous=last)
        notes = idle_exclusions(result.job.scene.segments, result.segments, result.people)
        return Solved(result, material_of(result, notes), decisions)

    def _tell(self, stage: str, share: float) -> None:
        self.progress = (stage, share)

    def _made_volumes(self, job: Job, name: str) -> Volumes:
        """In the background: what a segment's interest parts pass through."""
        spec = next(spec for spec in job.scene.segments if spec.name == name)
        a, b = volumes_of(segment_stages(job.scene, spec, self.people, fps=job.fps, store=job.store, workers=1))
        parts = segment_parts(spec)
        return part_of(a, parts[0]), part_of(b, parts[1])

    def _take_solved(self) -> bool:
        if self._solving is None or not self._solving.done():
            return False
        done, self._solving, self.progress = self._solving, None, None
        fault = done.exception()
        if fault is not None:
            self.message = _said("not solved", fault)
            return True
        solved = done.result()
        self._result, self.people, self.stale = solved.result, solved.result.people, False
        now = with_material(self.state, solved.material, solved.decisions)
        self.history = replace(self.history, now=now)
        failure = solved.result.failure
        self.message = "solved" if failure is None else f"no answer: {failure}"
        if not now.is_current:
            self._decided()
        return True

    def _take_volumes(self) -> bool:
        if self._measuring is None or not self._measuring[1].done():
            return False
        (key, done), self._measuring = self._measuring, None
        fault = done.exception()
        if fault is not None:
            self.message = _said("no volumes", fault)
            self.history = replace(self.history, now=replace(self.state, layers=self.state.layers - {Layer.VOLUMES}))
            return True
        self._volumes[key] = done.result()
        while len(self._volumes) > MOST_VOLUMES:
            self._volumes.pop(next(iter(self._volumes)))
        return True


def open_session(path: Path, *, workers: int = WORKERS, tell: Callable[[str], None] | None = None) -> Session:
    """Open a scene file or an output folder; what is not solved yet begins to be.

    Args:
        path: of either.
        workers: threads of a solve.
        tell: told what is missing.

    Raises:
        MhveditError: it is neither, or there is nothing at all to show.
    """
    opened = open_scene(path)
    for note in opened.material.notes:
        (tell or (lambda sentence: None))(note)
    session = Session(opened, workers=workers)
    if opened.stale and opened.job is not None:
        session.solve()
    return session


def _mirrored(job: Job) -> frozenset[str]:
    """The segments that the scene file tells from B's side."""
    told = {spec.name: spec.between for spec in load_scene(job.scene.file).segments}
    return frozenset(spec.name for spec in job.scene.segments if told[spec.name] != spec.between)


def _searched(decisions: Decisions, name: str) -> tuple[object, ...]:
    return decisions[name].searched


def _said(what: str, fault: BaseException) -> str:
    """A fault of the background in one line; one that is not the input's is told by its kind too."""
    words = " ".join(str(fault).split())
    return f"{what}: {words}" if isinstance(fault, MhveditError) else f"{what}: {type(fault).__name__}: {words}"
