"""The page on how a batch scales: figures in, Markdown and a picture out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.cluster_model import Course, Machinery, SceneWork, Work, bounds, course_of, repeated
from mhvedit.batch.run import AHEAD

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, PICTURE = DOCS / "scaling.md", DOCS / "pictures" / "scaling.webp"
MANY, WORKERS = 10_000, (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
SCALES = 0.8  # of the ideal speed: below, more workers no longer pay
PRICE = 0.04  # dollars a core and hour


@dataclass(frozen=True, slots=True)
class Measured:
    """A real batch."""

    workers: int
    seconds: float
    start: float  # s, until the cluster was there
    tasks: dict[str, list[float]]  # s, by kind
    peak_mb: float  # the most memory that a worker had
    read: float  # bytes a task
    written: float  # bytes a task
    moved: float  # bytes of a task's result, which go through the scheduler
    empty: float  # s, of a task that does nothing


INTRODUCTION = """# How far a batch scales

Made by `python -m benchmarks.scaling --write` on {machine}. Eight scenes, cuts of the bundled
sword fight that share no segment, are solved on one worker and on two, without the check on the meshes; workers have
one thread each, held to one core, and are warm. A model that is given what the tasks of the first run took then plays
{many:,} such scenes on up to 1,000 workers.

## Measured
"""
COURSE = """
*Model* is what the model below says of the same eight scenes, from the tasks of the run with one worker. A cluster was
there after {start:.1f} s. A worker had {peak:.0f} MB at most; a task read {read:.1f} MB and wrote {written:.1f} MB, and
the result that went through the scheduler had {moved:.0f} bytes: all else stays in the cache. A task that does nothing
took {empty:.2f} ms, scheduler, worker and client together.

## Modelled: {many:,} scenes
Scenes are handed in as `mhvedit batch` does, {ahead} a worker at a time. The scheduler hands out one task after the
other and takes {empty:.2f} ms for each; one shared storage moves {bandwidth:.0f} GB/s, a file server on a line of
10 Gbit (assumed, not measured); a core costs {price} dollars an hour (assumed). *Bound by* is the largest of what no
batch can be faster than: the workers' own time, the scheduler's, the storage's, the longest scene.

"""
ENDING = """
![Times as fast, by workers](pictures/scaling.webp)

It scales to {last} workers, of which at least {scales:.0f} % are used; beyond, everybody waits for the {binding}.
{remedy}

What the model leaves out: workers that slow each other down on one machine, as in the second row of the first table;
machines that come up or fail; a storage that gets slower the more ask for it; the check on the meshes, which takes
a scene longer than its answer and is nothing but workers' own time. Scenes that share segments, as those of a template
do, take less of everything.
"""
REMEDIES = {
    "storage": "Next would be meshes and volumes on each machine's own disk, so that only answers are shared.",
    "scheduler": "Next would be several batches, each with a scheduler of its own: scenes do not know of each other.",
    "longest scene": "Next would be tasks smaller than a segment.",
    "workers": "",
}


def scenes_of(measured: Measured) -> list[SceneWork]:
    """What each scene took; looking at subjects goes with the segments that wait for it."""
    look = sum(measured.tasks["look"]) / len(measured.tasks["segment"])
    segments = [Work(seconds + look, measured.read, measured.written) for seconds in measured.tasks["segment"]]
    finish = [Work(seconds, measured.read, measured.written) for seconds in measured.tasks["finish"]]
    each = len(segments) // len(finish)
    return [SceneWork(tuple(segments[i * each : (i + 1) * each]), last) for i, last in enumerate(finish)]


def predicted(scenes: Sequence[SceneWork], shared: Machinery) -> list[str]:
    """The table of the model, for 10,000 scenes."""
    rows = [
        "| workers | hours | times as fast | of ideal | core hours | dollars | bound by |",
        "|---|---|---|---|---|---|---|",
    ]
    many = list(repeated(scenes, MANY))
    courses = [course_of(many, workers, shared) for workers in WORKERS]
    for workers, course in zip(WORKERS, courses, strict=True):
        faster, hours = courses[0].seconds / course.seconds, course.seconds / 3600
        limits = bounds(many, workers, shared)
        rows.append(
            f"| {workers:,} | {hours:.2f} | {faster:,.1f} | {100 * faster / workers:.0f} % | {hours * workers:.1f} | "
            f"{hours * workers * PRICE:.2f} | {max(limits, key=lambda name: limits[name])} |"
        )
    return rows


def write_page(one: Measured, two: Measured, shared: Machinery, *, machine: str) -> None:
    """Write docs/scaling.md and its picture.

    Args:
        one: a batch on one worker.
        two: the same on two.
        shared: what the model takes for the scheduler and the storage.
        machine: that the batches ran on.
    """
    scenes = scenes_of(one)
    many = list(repeated(scenes, MANY))
    courses = {workers: course_of(many, workers, shared) for workers in WORKERS}
    scaling = [n for n, course in courses.items() if courses[1].seconds / course.seconds >= SCALES * n]
    limits = bounds(many, WORKERS[-1], shared)
    binding = max(limits, key=lambda name: limits[name])
    rows = ["| workers | seconds | times as fast | model | seconds of tasks |", "|---|---|---|---|---|"]
    for ran in (one, two):
        model = course_of(scenes, ran.workers, Machinery(shared.per_task, float("inf"))).seconds
        spent = sum(map(sum, ran.tasks.values()))
        rows.append(
            f"| {ran.workers} | {ran.seconds:.1f} | {one.seconds / ran.seconds:.2f} | {model:.1f} s | {spent:.1f} |"
        )
    course = COURSE.format(
        start=two.start,
        peak=max(one.peak_mb, two.peak_mb),
        read=one.read / 1e6,
        written=one.written / 1e6,
        moved=one.moved,
        empty=1000 * shared.per_task,
        ahead=AHEAD,
        bandwidth=shared.bandwidth / 1e9,
        price=PRICE,
        many=MANY,
    )
    ending = ENDING.format(last=scaling[-1], scales=100 * SCALES, binding=binding, remedy=REMEDIES[binding])
    PAGE.write_text(
        INTRODUCTION.format(machine=machine, many=MANY)
        + "\n".join(rows)
        + "\n"
        + course
        + "\n".join(predicted(scenes, shared))
        + "\n"
        + ending
    )
    _draw(courses)


def _draw(courses: Mapping[int, Course]) -> None:
    """Times as fast, beside the ideal."""
    figure = Figure(figsize=(6.4, 3.6), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    workers = list(courses)
    axes.plot(workers, workers, color="0.7", label="ideal")
    axes.plot(workers, [courses[1].seconds / courses[n].seconds for n in workers], marker="o", label="model")
    axes.set(xscale="log", yscale="log", xlabel="workers", ylabel="times as fast", title=f"{MANY:,} scenes")
    axes.legend()
    figure.savefig(PICTURE, pil_kwargs={"quality": 85})
