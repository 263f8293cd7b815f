import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.errors import CaptureError, MhveditError, SceneError
from mhvedit.pipeline.output import CACHE
from mhvedit.viewer.material import UNSOLVED, material_of
from mhvedit.viewer.opening import CHANGED, open_scene
from mhvedit.viewer.shot import shot
from mhvedit.viewer.state import in_segment, started
from mhvedit.viewer.words import status
from tests.pipeline.toy import write_scene


def test_an_output_is_opened_as_it_was_solved(made: Path, result: api.Result) -> None:
    there, fresh = open_scene(made / "out").material, material_of(result)
    assert there.notes == () and there.placed
    for name, track in fresh.tracks.items():
        np.testing.assert_array_equal(there.tracks[name].source, track.source)
        np.testing.assert_allclose(there.tracks[name].placements, track.placements, atol=1e-12)
    for a, b in zip(there.segments, fresh.segments, strict=True):
        assert (a.name, a.interaction, a.start, a.stop, a.chosen) == (b.name, b.interaction, b.start, b.stop, b.chosen)
        assert a.n_solutions == b.n_solutions and a.facing == pytest.approx(b.facing)
        np.testing.assert_array_equal(a.group.keys, b.group.keys)
        np.testing.assert_array_equal(a.group.region, b.group.region)
        np.testing.assert_allclose(a.grid.root_b, b.grid.root_b)


def test_a_scene_file_is_opened_unsolved_on_its_time_line(made: Path, result: api.Result) -> None:
    opened = open_scene(made / "scene.toml")
    assert opened.stale and opened.material.notes == (UNSOLVED,)
    assert result.assembly is not None
    assert opened.material.n_frames == result.assembly.scene.n_frames
    assert [s.name for s in opened.material.spans] == ["raise", "lower"]
    assert status(started(opened.material, {}).now)[0] == UNSOLVED


def test_a_scene_file_that_was_changed_since_is_said(folder: Path) -> None:
    os.utime(folder / "scene.toml", (2**31, 2**31))
    opened = open_scene(folder / "out")
    assert opened.stale and opened.material.notes == (CHANGED,)


def test_an_output_without_its_solutions_is_solved_again(folder: Path) -> None:
    shutil.rmtree(folder / "out" / "solutions")
    opened = open_scene(folder / "out")
    assert opened.stale and not opened.material.placed


def test_a_capture_that_is_not_there_leaves_the_other(folder: Path) -> None:
    shutil.rmtree(folder / "anna")
    for path in (folder / "out", folder / "scene.toml"):
        opened = open_scene(path)
        assert opened.job is None and set(opened.material.cast) == {"ben"}
        (note,) = opened.material.notes
        assert "subjects.anna.path: expected a folder" in note and "nothing can be solved or saved" in note
        now = started(opened.material, {}).now
        assert note in status(now)
        picture = shot(now, size=(700, 400)).astype(int)
        scene = picture[:300, :440]
        assert (scene[..., 0] - scene[..., 2] > 40).sum() > 200
        assert (scene[..., 2] - scene[..., 0] > 40).sum() < 20
    assert len(open_scene(folder / "out").material.segments) == 2


def test_both_captures_gone_leaves_the_maps(folder: Path) -> None:
    shutil.rmtree(folder / "anna")
    shutil.rmtree(folder / "ben")
    opened = open_scene(folder / "out")
    assert len(opened.material.notes) == 2 and not opened.material.cast
    now = in_segment(started(opened.material, {}).now, "raise")
    assert shot(now, size=(700, 400)).std() > 10
    with pytest.raises(SceneError, match=r"subjects\.anna\.path"):
        open_scene(folder / "scene.toml")


def test_an_empty_group_opens_and_says_why(folder: Path) -> None:
    scene = write_scene(folder, ("depth = 0.06, apart = 0.02}\n\n[[segments]]", "depth = 0.0}\n\n[[segments]]"))
    out = folder / "other"
    solved = api.solve(api.load(scene, cache=out / CACHE), workers=1)
    if solved.segment("raise").n_solutions:
        scene = write_scene(folder, ("visibility = {half_angle = 60}", "visibility = {half_angle = 0.5}"))
        solved = api.solve(api.load(scene, cache=out / CACHE), workers=1)
    assert solved.segment("raise").n_solutions == 0
    api.write(solved, out)
    for material in (open_scene(out).material, material_of(solved)):
        assert not material.placed and material.notes
        assert any("no answer" in note for note in material.notes)
        now = in_segment(started(material, {}).now, "raise")
        said = status(now)
        assert any(line.startswith("nothing fits") for line in said)
        assert shot(now, size=(700, 400)).std() > 10
    assert any("poses got that far" in line for line in said)


def test_what_cannot_be_opened(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(CaptureError, match="expected a scene file or an output folder"):
        open_scene(tmp_path / "nothing")
    with pytest.raises(CaptureError, match="output folder of `mhvedit solve` or `mhvedit avoid`, found no readable"):
        open_scene(folder / "anna")
    write_scene(folder, ("voxel = 0.04", "voxle = 0.04"))
    with pytest.raises(MhveditError, match="voxle"):
        open_scene(folder / "scene.toml")
