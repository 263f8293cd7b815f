"""`mhvedit export`: what it prints, what it writes, and what it refuses."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from mhvedit.errors import MissingLibrary
from mhvedit.geometry.planar import apply_pose
from mhvedit.pipeline import export as exporting
from mhvedit.pipeline.export import ExportSettings, check_request, export_scene, eyes_of
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.run import job_of
from mhvedit.scene.edit import EditedScene, SubjectEdit, read_edit
from mhvedit.sequences.read import open_capture
from tests.export.scenes import curve, write_edit
from tests.pipeline.test_bad_input import Command

SOURCE = {"anna": [0, 1, 2, 2, 5], "ben": [7, 8, 9, 10, 11]}
EDIT = EditedScene(
    "toy", 30.0, 5, {who: SubjectEdit(np.array(s), curve(5, i + 0.2)) for i, (who, s) in enumerate(SOURCE.items())},
    (), 0.0, 0.0, 0.0,
)  # fmt: skip


@pytest.fixture
def out(folder: Path) -> Path:
    """An output folder whose scene file and captures a test may spoil."""
    return write_edit(folder / "out", EDIT, folder / "scene.toml")


@pytest.mark.parametrize("name", ["s.usd", "s.usda", "s.usdc", "s.usdz", "S.GLB", "meshes"])
def test_every_format(mhvedit: Command, out: Path, tmp_path: Path, name: str) -> None:
    ran = mhvedit("export", out, "--to", tmp_path / name)
    assert (ran.code, ran.out, ran.err) == (0, f"written to {tmp_path / name}\n", "")
    assert (tmp_path / name).exists() and not list(tmp_path.glob(".*"))
    again = mhvedit("export", out, "--to", tmp_path / name)
    kind = "a folder" if name == "meshes" else "a file"
    assert again.code == 2
    assert again.sentence == f"{tmp_path / name}: expected nothing there, or --force to write over it, found {kind}"
    forced = mhvedit("export", out, "--to", tmp_path / name, "--force", "--json")
    assert forced.code == 0
    said = json.loads(forced.out)
    assert said["written"] == str(tmp_path / name) and said["warnings"] == []
    assert said["offset"] == [0, 0, 0]
    kept = name in ("s.usd", "s.usda", "s.usdc")
    assert said["kept"] == [str(tmp_path / "s_assets" / f"{who}.usdc") for who in SOURCE if kept]


def test_what_people_hold_comes_along(mhvedit: Command, out: Path, folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "ben", folder / "stick")
    scene = (folder / "scene.toml").read_text().replace("[subjects.ben]", 'stick = {path = "stick"}\n[subjects.ben]', 1)
    (folder / "scene.toml").write_text(scene)
    assert mhvedit("export", out, "--to", tmp_path / "meshes", "--format", "ply").code == 0
    assert sorted(p.name for p in (tmp_path / "meshes").iterdir()) == ["anna", "anna_stick", "ben", "export.json"]
    captured = open_capture(folder / "stick", name="stick")
    for k, number in enumerate(SOURCE["anna"]):
        seen = trimesh.load_mesh(tmp_path / "meshes" / "anna_stick" / f"anna_stick_{k:04d}.ply", process=False)
        there = apply_pose(EDIT.subjects["anna"].placements[k], captured.mesh(number).vertices)
        assert_array_equal(seen.vertices, there.astype(np.float32))


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("s.fbx", (), "expected a name ending in .usd .usda .usdc .usdz .glb .mp4, or a folder's, found '.fbx'"),
        ("no/s.glb", (), "no to write into, found nothing there"),
        ("s.glb", ("--flatten",), "expected options that concern a .glb, found --flatten"),
        ("s.usda", ("--draco",), "expected options that concern USD, found --draco"),
        ("meshes", ("--size", "64x64"), "expected options that concern a folder of meshes, found --size"),
        ("s.mp4", ("--format", "ply"), "expected options that concern a movie, found --format"),
        (
            "s.usdz",
            ("--assets", "x"),
            "expected --assets with an edit layer, not with a flattened stage, found --assets",
        ),
        ("meshes", ("--format", "stl"), "--format: expected obj or ply, found 'stl'"),
        ("meshes", ("--up", "x"), "--up: expected y or z, found 'x'"),
        ("s.mp4", ("--size", "big"), "--size: expected WIDTHxHEIGHT like 1280x720, found 'big'"),
        ("s.mp4", ("--size", "9x9"), "expected a size from 16 to 8192 pixels a side, found 9x9"),
        ("s.mp4", ("--camera", "zoe"), "expected --camera fixed, orbit, anna or ben, found 'zoe'"),
        ("s.mp4", ("--fps", "0"), "Invalid value for '--fps'"),
    ],
)
def test_requests_that_cannot_be_met(
    mhvedit: Command, out: Path, tmp_path: Path, name: str, options: tuple[str, ...], said: str
) -> None:
    before = sorted(tmp_path.iterdir())
    ran = mhvedit("export", out, "--to", tmp_path / name, *options)
    assert ran.code == 2 and said in ran.sentence
    assert sorted(tmp_path.iterdir()) == before


def test_folders_of_others_are_never_replaced(mhvedit: Command, out: Path, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "letter.txt").write_text("dear")
    ran = mhvedit("export", out, "--to", tmp_path / "home", "--force")
    assert ran.code == 2
    assert ran.sentence.endswith(
        "expected a new folder, or one that `mhvedit export` has written, found a folder of other files"
    )
    assert (tmp_path / "home" / "letter.txt").read_text() == "dear"


def test_an_empty_folder_is_taken(mhvedit: Command, out: Path, tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    assert mhvedit("export", out, "--to", tmp_path / "new").code == 0


def test_a_capture_that_is_gone(mhvedit: Command, out: Path, folder: Path, tmp_path: Path) -> None:
    shutil.rmtree(folder / "ben")
    ran = mhvedit("export", out, "--to", tmp_path / "s.glb")
    assert ran.code == 2 and "subjects.ben.path" in ran.sentence and not (tmp_path / "s.glb").exists()


def test_a_frame_that_is_gone(mhvedit: Command, out: Path, folder: Path, tmp_path: Path) -> None:
    [gone] = (folder / "ben").glob("*0008.obj")
    gone.unlink()
    ran = mhvedit("export", out, "--to", tmp_path / "s.glb")
    assert ran.code == 2 and ran.sentence == "ben: expected frame 8, found 0 to 15 (15 frames)"


def test_an_edit_of_other_people(mhvedit: Command, folder: Path, tmp_path: Path) -> None:
    other = replace(EDIT, subjects={"anna": EDIT.subjects["anna"], "zoe": EDIT.subjects["ben"]})
    ran = mhvedit("export", write_edit(folder / "out", other, folder / "scene.toml"), "--to", tmp_path / "s.glb")
    assert ran.code == 2 and "(anna, ben), found anna, zoe" in ran.sentence


def test_nothing_solved(mhvedit: Command, tmp_path: Path) -> None:
    ran = mhvedit("export", tmp_path / "out", "--to", tmp_path / "s.glb")
    assert ran.sentence == f"{tmp_path}/out/edit.json: expected an edit written by `mhvedit solve`, found no such file"


def test_movies_without_the_encoder(
    mhvedit: Command, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    ran = mhvedit("export", out, "--to", tmp_path / "s.mp4")
    assert ran.code == 2
    assert ran.sentence == "writing a movie needs a library that is not installed: pip install 'mhvedit[video]'"


def test_movies_without_anything_to_draw_with(out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise MissingLibrary("drawing in 3D", "a driver")

    monkeypatch.setattr(exporting, "check_can_draw", refuse)
    with pytest.raises(MissingLibrary):
        exporting.export_output(out, tmp_path / "s.mp4", ExportSettings())
    assert not list(tmp_path.glob("*.mp4"))


@pytest.mark.parametrize("camera", ["fixed", "orbit", "ben"])
def test_movies(mhvedit: Command, out: Path, tmp_path: Path, camera: str) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    ran = mhvedit("export", out, "--to", tmp_path / "s.mp4", "--camera", camera, "--size", "97x65", "--fps", "60")
    assert ran.code == 0
    assert ran.err == "warning: 97x65 is drawn as 98x66: H.264 needs even sides\n"
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    decoded = subprocess.run(
        [ffmpeg, "-i", str(tmp_path / "s.mp4"), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True
    )
    assert b"98x66" in decoded.stderr and b"60 fps" in decoded.stderr
    pictures = np.frombuffer(decoded.stdout, np.uint8).reshape(-1, 66, 98, 3)
    assert len(pictures) == 10
    assert all(picture.std() > 5 for picture in pictures)
    first = (tmp_path / "s.mp4").read_bytes()
    mhvedit("export", out, "--to", tmp_path / "s.mp4", "--camera", camera, "--size", "98x66", "--fps", "60", "--force")
    assert (tmp_path / "s.mp4").read_bytes() == first


def test_eyes_go_with_their_owner(out: Path) -> None:
    edit, job = read_edit(out / "edit.json"), job_of(out)
    eyes = eyes_of(edit, job, "ben")
    tracks = meet_people(job.scene, job.subjects, job.store)["ben"].gaze
    for k, number in enumerate(SOURCE["ben"]):
        placement = edit.subjects["ben"].placements[k]
        row = tracks.numbers.tolist().index(number)
        ahead = apply_pose(placement, tracks.eye[row] + tracks.direction[row])
        assert_allclose(eyes.eye[k], apply_pose(placement, tracks.eye[row]))
        assert_allclose(eyes.eye[k] + eyes.direction[k], ahead)


def test_pieces_have_names_of_their_own(out: Path, folder: Path) -> None:
    shutil.copytree(folder / "ben", folder / "stick")
    text = (folder / "scene.toml").read_text().replace("anna", "x").replace("ben", "x_stick")
    text = text.replace('path = "x"', 'path = "anna"').replace('path = "x_stick"', 'path = "ben"')
    text = text.replace('"x.csv"', '"anna.csv"').replace('"x_stick.csv"', '"ben.csv"')
    (folder / "scene.toml").write_text(
        text.replace("[subjects.x_stick]", 'stick = {path = "stick"}\n[subjects.x_stick]', 1)
    )
    edit = replace(EDIT, subjects={"x": EDIT.subjects["anna"], "x_stick": EDIT.subjects["ben"]})
    write_edit(out, edit, folder / "scene.toml")
    scene = export_scene(edit, job_of(out), out)
    assert [piece.name for piece in scene.pieces] == ["x", "x_stick_", "x_stick"]


def test_every_setting_concerns_a_format(tmp_path: Path) -> None:
    known = frozenset().union(*exporting.CONCERNS.values())
    assert known == set(ExportSettings.__dataclass_fields__)
    check_request(tmp_path / "s.usdc", ExportSettings(flatten=True, up="y"), force=False)
