"""The check in stretches: what the check of the whole scene finds, and nothing twice."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.planar import compose
from mhvedit.pipeline import measure
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.measure import measure_scene, stretches
from mhvedit.scene.checks import check_scene
from mhvedit.scene.edit import EditedScene, SubjectEdit
from mhvedit.scene.report import SceneReport, report_as_dict
from tests.pipeline.toy import N_FRAMES


@pytest.fixture(scope="module")
def result(captures: Path, tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Solved, with a cache."""
    return api.solve(api.load(captures / "scene.toml", cache=tmp_path_factory.mktemp("cache")))


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by the number of frames with every stretch that is measured."""
    frames: list[int] = []

    def counted(scene: EditedScene, *args: object, **options: object) -> SceneReport:
        frames.append(scene.n_frames)
        return check_scene(scene, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(measure, "check_scene", counted)
    return frames


def edit_of(result: Result) -> EditedScene:
    assert result.assembly is not None
    return result.assembly.scene


def moved(scene: EditedScene, change: Callable[[str, SubjectEdit], np.ndarray]) -> EditedScene:
    """The scene with other placements."""
    edits = {name: replace(edit, placements=change(name, edit)) for name, edit in scene.subjects.items()}
    return replace(scene, subjects=edits)


def close(one: object, other: object) -> None:
    """The same but for roundings, which decide where among equally deep places the deepest is said to be."""
    if isinstance(one, dict) and isinstance(other, dict):
        assert one.keys() == other.keys()
        for key in one.keys() - {"deepest_at", "contact_at"}:
            close(one[key], other[key])
    elif isinstance(one, list) and isinstance(other, list):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            close(a, b)
    else:
        assert one == (pytest.approx(other, abs=0.02) if isinstance(other, float) else other)


def test_stretches_cover_the_scene(result: Result) -> None:
    assert list(stretches(edit_of(result))) == [(0, 7), (7, 9), (9, N_FRAMES)]


def test_stretches_say_what_the_whole_says(result: Result) -> None:
    """Wherever the pair stands."""
    world = np.array([0.7, -1.1, 0.9])
    scene = moved(edit_of(result), lambda name, edit: compose(world, edit.placements))
    whole = report_as_dict(measure._measured(result.job, result.people, scene))
    close(report_as_dict(measure_scene(result.job, result.people, scene)), whole)


def test_nothing_is_checked_twice(result: Result, checked: list[int]) -> None:
    scene = edit_of(result)
    first = report_as_dict(measure_scene(result.job, result.people, scene))
    checked.clear()
    assert report_as_dict(measure_scene(result.job, result.people, scene)) == first
    turned = moved(scene, lambda name, edit: compose(np.array([2.0, 1.0, 0.4]), edit.placements))
    measure_scene(result.job, result.people, turned)
    assert checked == []


def test_what_moved_is_checked_again(result: Result, checked: list[int]) -> None:
    scene = edit_of(result)
    measure_scene(result.job, result.people, scene)
    checked.clear()

    def nearer(name: str, edit: SubjectEdit) -> np.ndarray:
        placements = edit.placements.copy()
        placements[9:, 0] += 0.003 * (name == "ben")
        return placements

    measure_scene(result.job, result.people, moved(scene, nearer))
    assert checked == [7]


def test_sub_steps_are_measured_across_stretches(result: Result, checked: list[int]) -> None:
    report = measure_scene(result.job, result.people, edit_of(result), between_frames=1)
    assert checked == [N_FRAMES]
    assert report.pairs[0].between_gap is not None and len(report.pairs[0].between_gap) == N_FRAMES - 1


def test_progress_ends_with_the_last_frame(result: Result) -> None:
    told: list[tuple[int, int]] = []
    measure_scene(result.job, result.people, edit_of(result), progress=lambda *count: told.append(count))
    assert told[-1] == (N_FRAMES, N_FRAMES) and told == sorted(told)
