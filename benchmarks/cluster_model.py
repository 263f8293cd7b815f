"""A batch as a queue: workers, a scheduler that hands out one task at a time, storage that all share."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

from mhvedit.batch.run import AHEAD, LEAST_AHEAD


@dataclass(frozen=True, slots=True)
class Work:
    """What one kind of task takes."""

    seconds: float  # of a worker
    read: float  # bytes, from the storage
    written: float  # bytes, to it


@dataclass(frozen=True, slots=True)
class SceneWork:
    """What one scene takes: tasks that do not wait for each other, and then the one that ends it."""

    segments: tuple[Work, ...]
    finish: Work


@dataclass(frozen=True, slots=True)
class Machinery:
    """What the workers share."""

    per_task: float  # s, of the scheduler
    bandwidth: float  # bytes a second, of the storage


@dataclass(frozen=True, slots=True)
class Course:
    """How a batch went."""

    seconds: float  # from the first task to the last
    busy: float  # s, of all workers together, waits for the storage not among them
    waits: float  # s, of all workers together, for the storage


def course_of(scenes: Sequence[SceneWork], workers: int, machinery: Machinery) -> Course:
    """Play a batch through, as `mhvedit.batch.run` hands it in: scenes in order, a few a worker at a time.

    Args:
        scenes: in order.
        workers: of one thread.
        machinery: what they share.
    """
    waiting, ahead = iter(enumerate(scenes)), max(LEAST_AHEAD, AHEAD * workers)
    ready: list[tuple[int, int, Work]] = []  # order of the scene, of the task; what it takes
    events: list[tuple[float, int, int]] = []  # when, which, of which scene
    left: dict[int, int] = {}  # segments of a scene that are not solved
    number, idle, now = count(), workers, 0.0
    scheduler = storage = busy = waits = 0.0

    def hand_in() -> None:
        while len(left) < ahead and (entry := next(waiting, None)) is not None:
            order, scene = entry
            left[order] = len(scene.segments)
            for work in scene.segments:
                heappush(ready, (order, next(number), work))

    hand_in()
    while left:
        while idle and ready:
            order, _, work = heappop(ready)
            idle -= 1
            scheduler = max(now, scheduler) + machinery.per_task
            storage = max(scheduler, storage) + (work.read + work.written) / machinery.bandwidth
            waits += storage - scheduler
            busy += work.seconds
            heappush(events, (storage + work.seconds, next(number), order))
        now, _, order = heappop(events)
        idle += 1
        left[order] -= 1
        if left[order] == 0:
            heappush(ready, (order, next(number), scenes[order].finish))
        elif left[order] < 0:
            del left[order]
            hand_in()
    return Course(now, busy, waits)


def bounds(scenes: Sequence[SceneWork], workers: int, machinery: Machinery) -> dict[str, float]:
    """Seconds that no batch on these workers can be faster than, by what sees to that."""
    tasks = [work for scene in scenes for work in (*scene.segments, scene.finish)]
    longest = max(max(work.seconds for work in scene.segments) + scene.finish.seconds for scene in scenes)
    return {
        "workers": sum(work.seconds for work in tasks) / workers,
        "scheduler": len(tasks) * machinery.per_task,
        "storage": sum(work.read + work.written for work in tasks) / machinery.bandwidth,
        "longest scene": longest,
    }


def repeated(scenes: Sequence[SceneWork], total: int) -> Iterator[SceneWork]:
    """So many scenes, like some that were measured."""
    return (scenes[i % len(scenes)] for i in range(total))
