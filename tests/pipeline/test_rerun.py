"""The same answer every time, and a second run that redoes only what its inputs changed."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.pipeline import run
from mhvedit.pipeline.run import Outcome, run_scene
from tests.pipeline.toy import ANNA, BEN, LOWER_TABLE, files_of, write_actor, write_scene

pytestmark = pytest.mark.usefixtures("unmeasured")
Solved = tuple[Path, Outcome]


@pytest.fixture
def out(folder: Path) -> Path:
    """Solved once."""
    run_scene(folder / "scene.toml", folder / "out", report=False)
    return folder / "out"


def again(out: Path, *changes: tuple[str, str]) -> Outcome:
    return run_scene(write_scene(out.parent, *changes), out, report=False)


def test_workers_do_not_matter(solved: Solved, captures: Path, tmp_path: Path) -> None:
    run_scene(captures / "scene.toml", tmp_path / "out", workers=2, report=False)
    first, second = files_of(solved[0]), files_of(tmp_path / "out")
    assert first["edit.json"] == second["edit.json"]
    for name in ("raise", "lower"):
        with (
            np.load(solved[0] / f"solutions/{name}.npz") as a,
            np.load(tmp_path / f"out/solutions/{name}.npz") as b,
        ):
            assert a.files == b.files
            for key in a.files:
                np.testing.assert_array_equal(a[key], b[key])


@pytest.mark.parametrize("kind", ["ply", "npz"])
def test_how_a_capture_is_stored_does_not_matter(solved: Solved, tmp_path: Path, kind: str) -> None:
    write_actor(tmp_path, "anna", ANNA, kind=kind)
    write_actor(tmp_path, "ben", BEN)
    named = "anna.npz" if kind == "npz" else "anna"
    run_scene(write_scene(tmp_path, ('path = "anna"', f'path = "{named}"')), tmp_path / "out", report=False)
    assert files_of(tmp_path / "out")["edit.json"] == files_of(solved[0])["edit.json"]


def test_nothing_changed(out: Path, searches: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    before = {name: (out / name).stat().st_mtime_ns for name in files_of(out)}
    monkeypatch.setattr(run, "measure_scene", None)
    assert not again(out).redone
    assert searches == []
    assert before == {name: (out / name).stat().st_mtime_ns for name in files_of(out)}


def test_a_comment_changed(out: Path, searches: list[int]) -> None:
    assert not again(out, ("version = 1", "# a comment\nversion = 1")).redone
    assert searches == []


def test_one_segments_tolerance_changed(out: Path, searches: list[int]) -> None:
    before = (out / "solutions" / "lower.npz").read_bytes()
    outcome = again(out, (LOWER_TABLE, LOWER_TABLE.replace("voxels = 1", "voxels = 2")))
    assert outcome.redone and len(searches) == 1
    assert (out / "solutions" / "lower.npz").read_bytes() != before or outcome.report["segments"][1]["solutions"] > 0


def test_only_weights_changed(out: Path, searches: list[int]) -> None:
    assert again(out, ("[search]", "[optimise]\nfacing_weight = 2.0\n\n[search]")).redone
    assert searches == []


def test_a_segments_name_changed(out: Path, searches: list[int]) -> None:
    again(out, ('name = "lower"', 'name = "sink"'))
    assert searches == []
    assert {n for n in files_of(out) if n.startswith("solutions")} == {"solutions/raise.npz", "solutions/sink.npz"}


@pytest.mark.parametrize("when", [(1, 1), None])
def test_a_capture_that_was_touched(out: Path, searches: list[int], when: tuple[int, int] | None) -> None:
    for file in (out.parent / "ben").iterdir():
        os.utime(file, when)
    assert not again(out).redone and searches == []


def test_a_capture_that_was_copied_elsewhere(out: Path, searches: list[int]) -> None:
    shutil.copytree(out.parent / "ben", out.parent / "copied")
    assert again(out, ('path = "ben"', 'path = "copied"')).redone  # the scene file names another folder
    assert searches == []


@pytest.mark.parametrize(("frame", "segments"), [(4, 1), (8, 0)])
def test_a_frame_changed(out: Path, searches: list[int], frame: int, segments: int) -> None:
    """It is of the first segment, or of none; size and time stay as they were."""
    file = out.parent / "ben" / f"ben_{frame:04}.obj"
    stat = file.stat()
    lines = file.read_text().splitlines(keepends=True)
    faces = [i for i, line in enumerate(lines) if line.startswith("f ")]
    lines[faces[0]], lines[faces[1]] = lines[faces[1]], lines[faces[0]]
    file.write_text("".join(lines))
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert file.stat().st_size == stat.st_size
    assert again(out).redone
    assert len(searches) == segments


@pytest.mark.parametrize(("frame", "segments"), [(4, 1), (8, 0), (99, 0)])
def test_a_track_changed(out: Path, searches: list[int], frame: int, segments: int) -> None:
    """Of the hand, in a frame of the first segment, or of none: parts, and with them solutions, change."""
    track = out.parent / "ben.csv"
    start = f"{frame},hand,"
    lines = [line if not line.startswith(start) else line + "1" for line in track.read_text().splitlines()]
    track.write_text("\n".join(lines if any(line.startswith(start) for line in lines) else [*lines, f"{start}0,0,1"]))
    again(out)
    assert len(searches) == segments


def test_a_gaze_changed_where_nobody_has_to_be_seen(out: Path, searches: list[int]) -> None:
    unseen = ("visibility = {half_angle = 60}", "visibility = false")
    again(out, unseen)
    track = out.parent / "anna.csv"
    rows = [row.replace(",1.4", ",1.5") if ",target," in row else row for row in track.read_text().splitlines()]
    track.write_text("\n".join(rows) + "\n")
    searches.clear()
    assert again(out, unseen).redone and searches == []  # the report draws what she sees
    assert not again(out, unseen).redone


def test_a_frame_that_is_not_used_goes_and_comes_back(out: Path, searches: list[int]) -> None:
    used = ('path = "ben"', 'path = "ben"\nframes = [0, 14]')
    table = (LOWER_TABLE, LOWER_TABLE.replace("[9, 15]", "[8, 14]"))
    file = out.parent / "ben" / "ben_0013.obj"
    first = again(out, used, table).report["warnings"]
    shutil.copy(file, out.parent / "ben" / "ben_0020.obj")
    assert again(out, used, table).report["warnings"] != first
    (out.parent / "ben" / "ben_0020.obj").unlink()
    assert again(out, used, table).report["warnings"] == first


def test_a_picture_that_was_missing_comes(out: Path) -> None:
    folder = out.parent / "anna"
    (folder / "skin.mtl").write_text("newmtl skin\nmap_Kd tex/skin.png\n")
    for file in folder.glob("*.obj"):
        file.write_text("mtllib skin.mtl\nusemtl skin\n" + file.read_text())
    (folder / "tex").mkdir()
    (said,) = again(out).report["warnings"]
    assert "1 texture files are missing" in said
    (folder / "tex" / "skin.png").write_bytes(b"a picture")
    assert again(out).report["warnings"] == []
    (folder / "tex" / "skin.png").unlink()
    assert again(out).report["warnings"] == [said]


def test_an_answer_that_somebody_changed_is_written_again(out: Path) -> None:
    before = files_of(out)
    for name in ("edit.json", "report.json", "solutions/raise.npz"):
        (out / name).write_bytes(b"{}")
        assert again(out).redone
        assert files_of(out)["edit.json"] == before["edit.json"]
        assert json.loads((out / "report.json").read_text())["solved"]
        with np.load(out / "solutions" / "raise.npz") as kept:
            assert len(kept["x"])


def test_another_solution_that_was_written_there_gives_way(out: Path) -> None:
    before = files_of(out)["edit.json"]
    result = api.solve(api.load(out.parent / "scene.toml", cache=out / ".cache"))
    assert result.assembly is not None
    row = 0 if result.assembly.chosen[0] else 1
    api.write(api.choose(result, {"raise": row}), out)
    assert files_of(out)["edit.json"] != before
    again(out)
    assert files_of(out)["edit.json"] == before


def test_a_page_of_another_answer_is_taken_away(out: Path) -> None:
    (out / "report.html").write_text("of an earlier answer")
    again(out, ("window = 2.4", "window = 2.6"))
    assert not (out / "report.html").exists()


@pytest.mark.parametrize("spoil", ["truncate", "garble", "empty", "another"])
def test_a_damaged_cache_is_rebuilt(
    out: Path, spoil: str, searches: list[int], caplog: pytest.LogCaptureFixture
) -> None:
    before = files_of(out)
    (out / "edit.json").unlink()
    spoilt = out / ".cache" / ("results" if spoil == "another" else "")
    for file in [p for p in spoilt.rglob("*") if p.is_file()]:
        file.write_bytes(SPOILT[spoil](file.read_bytes()))
    again(out)
    assert len(searches) == 2
    assert files_of(out)["edit.json"] == before["edit.json"]
    assert "damaged" in caplog.text


SPOILT: dict[str, Callable[[bytes], bytes]] = {
    "truncate": lambda data: data[: len(data) // 2],
    "garble": lambda data: data[:60] + bytes(255 - b for b in data[60:120]) + data[120:],
    "empty": lambda data: b"",
    "another": lambda data: b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (0,), }".ljust(
        128
    ),
}


def test_a_linked_output_folder(folder: Path, tmp_path: Path) -> None:
    """`check` finds the scene file again through a link that leads elsewhere."""
    (tmp_path / "far" / "away" / "disk").mkdir(parents=True)
    out = folder / "out"
    out.symlink_to(tmp_path / "far" / "away" / "disk")
    run_scene(folder / "scene.toml", out, report=False)
    assert run.job_of(out).scene.name == "toy"
