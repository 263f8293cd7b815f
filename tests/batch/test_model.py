"""The model of a cluster against what must be true of any."""

from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from benchmarks.cluster_model import Machinery, SceneWork, Work, bounds, course_of

WORKS = st.builds(Work, st.floats(0.1, 10), st.floats(0, 100), st.floats(0, 100))
ONE = st.builds(SceneWork, st.lists(WORKS, min_size=1, max_size=4).map(tuple), WORKS)
SCENES = st.lists(ONE, min_size=1, max_size=40)
SOME = settings(max_examples=60, derandomize=True)
SHARED = st.builds(Machinery, st.floats(0, 0.5), st.floats(10, 1e6))


@SOME
@given(scenes=SCENES, workers=st.integers(1, 12), shared=SHARED)
def test_no_batch_is_faster_than_its_bounds(scenes: list[SceneWork], workers: int, shared: Machinery) -> None:
    course = course_of(scenes, workers, shared)
    assert course.seconds >= max(bounds(scenes, workers, shared).values()) * (1 - 1e-9)
    assert course.busy == approx(sum(w.seconds for s in scenes for w in (*s.segments, s.finish)))


@SOME
@given(scenes=SCENES, shared=SHARED)
def test_one_worker_does_one_thing_after_the_other(scenes: list[SceneWork], shared: Machinery) -> None:
    tasks = [work for scene in scenes for work in (*scene.segments, scene.finish)]
    moved = sum(work.read + work.written for work in tasks)
    expected = sum(work.seconds for work in tasks) + len(tasks) * shared.per_task + moved / shared.bandwidth
    assert course_of(scenes, 1, shared).seconds == approx(expected)


def test_equal_scenes_on_as_many_workers() -> None:
    """All segments at once, then all ends at once."""
    scenes = [SceneWork((Work(3.0, 0, 0),), Work(2.0, 0, 0))] * 8
    assert course_of(scenes, 8, Machinery(0.0, 1.0)).seconds == approx(5.0)
    assert course_of(scenes, 4, Machinery(0.0, 1.0)).seconds == approx(10.0)


def test_a_slow_scheduler_is_what_all_wait_for() -> None:
    scenes = [SceneWork((Work(1.0, 0, 0),), Work(1.0, 0, 0))] * 1000
    assert course_of(scenes, 500, Machinery(0.1, 1.0)).seconds == approx(200.0, rel=0.05)
