"""Bad input: exit code 2, one line that says where, what was expected and what was there; nothing is written."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.pipeline.toy import ANNA, BEN, LOWER_TABLE, RAISE_TABLE, Ran, files_of, write_actor, write_scene

pytestmark = pytest.mark.usefixtures("unmeasured")
Command = Callable[..., Ran]
Spoil = Callable[[Path], object]
PARTS = "parts = {anna = "
BEFORE = {"edit.json": b"of an earlier run", "report.html": b"its page"}
BOX = "hand = {center = [CENTRE], size = [0.3, 0.3, 0.3]}"
TRACKED = 'hand = {track = "anna.csv", joint = "hand", radius = 0.12}'


@pytest.fixture
def refused(mhvedit: Command, folder: Path) -> Callable[..., str]:
    """Solves, and sees to it that nothing but one line comes of it; returns the line."""

    def call(*changes: tuple[str, str]) -> str:
        if changes:
            write_scene(folder, *changes)
        out = folder / "out"
        out.mkdir(exist_ok=True)
        for name, content in BEFORE.items():
            (out / name).write_bytes(content)
        ran = mhvedit("solve", folder / "scene.toml", "-o", out, "--no-report")
        assert ran.code == 2 and ran.out == ""
        assert files_of(out) == BEFORE
        return ran.sentence.replace(str(folder), "JOB")

    return call


def rewrite(file: str, change: Callable[[str], str]) -> Spoil:
    return lambda folder: (folder / file).write_text(change((folder / file).read_text()))


def nan_at(number: int) -> Spoil:
    def spoil(text: str) -> str:
        _, *rest = text.splitlines()
        return "\n".join(["v nan 0 0", *rest]) + "\n"

    return rewrite(f"ben/ben_{number:04}.obj", spoil)


def remove(*files: Path) -> None:
    for file in files:
        file.unlink()


def flat(folder: Path) -> None:
    text = (folder / "ben" / "ben_0003.obj").read_text()
    (folder / "ben" / "ben_0003.obj").write_text(
        "".join(f"{row}\n" for row in text.splitlines() if row[0] == "v") + "f 1 1 2\n"
    )


SPOILT: dict[str, tuple[Spoil, str]] = {
    "missing folder": (
        lambda folder: shutil.rmtree(folder / "ben"),
        "JOB/scene.toml: subjects.ben.path: expected a folder of numbered meshes, a .npz or a USD file, "
        "found nothing at JOB/ben",
    ),
    "empty folder": (
        lambda folder: remove(*(folder / "ben").iterdir()),
        "JOB/ben: expected numbered files like body_0001 ending in .obj .ply .stl .glb .drc, found an empty folder",
    ),
    "unparsable": (
        rewrite("ben/ben_0000.obj", lambda text: "v 1 2\nf 1 2 3\n"),
        "JOB/ben/ben_0000.obj: expected three coordinates a vertex, found 2",
    ),
    "binary": (
        lambda folder: (folder / "ben" / "ben_0009.obj").write_bytes(bytes(range(256)) * 9),
        "JOB/ben/ben_0009.obj: ",
    ),
    "empty file": (
        lambda folder: (folder / "ben" / "ben_0002.obj").write_bytes(b""),
        "JOB/ben/ben_0002.obj: expected a .obj mesh, found an empty file",
    ),
    "nan": (nan_at(0), "JOB/ben/ben_0000.obj: expected finite vertices, found (nan, 0, 0) at vertex 0 (1 such)"),
    "nan in the middle": (
        nan_at(8),
        "JOB/ben/ben_0008.obj: expected finite vertices, found (nan, 0, 0) at vertex 0 (1 such)",
    ),
    "no faces": (
        rewrite("ben/ben_0007.obj", lambda text: text[: text.index("f ")]),
        "JOB/ben/ben_0007.obj: expected at least one face, found 40 vertices and no faces",
    ),
    "faces without area": (flat, "ben, frame 3: expected faces that have an area, found none that has"),
    "missing frames": (
        lambda folder: remove(*(folder / "ben" / f"ben_{n:04}.obj" for n in (3, 4))),
        'JOB/scene.toml: segments[0] "raise".frames.ben: expected frames that the capture has, '
        "found [0, 6] without frames 3, 4",
    ),
    "track of words": (
        rewrite("anna.csv", lambda text: text.replace("0,hand,", "0,hand,x", 1)),
        "JOB/anna.csv: line 2: expected a frame number, a joint and three numbers, found ",
    ),
    "track that ends early": (
        rewrite("anna.csv", lambda text: cut_short(text)),
        'JOB/scene.toml: subjects.anna.parts.hand.track: expected joint "hand" in frames 9 to 15, '
        'those of segments[1] "lower", found none in frames 12, 13, 14 and 1 more',
    ),
    "facing upwards": (
        rewrite("anna.csv", lambda text: upwards(text)),
        "JOB/scene.toml: subjects.anna.facing: expected a direction with a horizontal part in every frame, "
        "found none in frame 5",
    ),
    "target in the eye": (
        rewrite("anna.csv", lambda text: eyeless(text)),
        "JOB/scene.toml: subjects.anna.gaze: expected an eye and a target elsewhere in every frame, "
        "found none in frame 5",
    ),
}  # fmt: skip


def cut_short(text: str) -> str:
    return text[: text.index("12,hand")] + "".join(f"{n},facing,1,0,0\n" for n in range(12, 16))


def upwards(text: str) -> str:
    return "\n".join("5,facing,0,0,1" if row.startswith("5,facing") else row for row in text.splitlines())


def eyeless(text: str) -> str:
    eye = next(row for row in text.splitlines() if row.startswith("5,eye"))
    return "\n".join(eye.replace("eye", "target") if row.startswith("5,target") else row for row in text.splitlines())


@pytest.mark.parametrize("what", SPOILT)
def test_spoilt_files(refused: Callable[..., str], folder: Path, what: str) -> None:
    spoil, expected = SPOILT[what]
    spoil(folder)
    assert refused().startswith(expected)


SAID: dict[str, tuple[tuple[str, str], str]] = {
    "frames outside": (
        ("{anna = [9, 15], ben = [9, 15]}", "{anna = [9, 15], ben = [9, 17]}"),
        'segments[1] "lower".frames.ben: expected frames from 0 to 15, those of the capture, found [9, 17]',
    ),
    "overlap": (
        ("{anna = [9, 15], ben = [9, 15]}", "{anna = [5, 15], ben = [9, 15]}"),
        'segments[1] "lower".frames.anna: expected ',
    ),
    "out of order": (
        ("[search]", RAISE_TABLE.replace('"raise"', '"again"') + "[search]"),
        'segments[2] "again".frames.',
    ),
    "key": (("[search]", "[serach]"), "serach: expected one of version, name, fps, subjects, segments, search, "),
    "inner key": (("apart = 0.02", "apart = 0.02, deep = 1"), 'segments[0].tolerance.deep: expected one of '),
    "type": (('"+&+"', '"+&&"'), "segments[0].interaction: expected one of +&+, "),
    "part": ((f'{PARTS}"hand"', f'{PARTS}"hnad"'), "segments[0].parts.anna: expected one of "),
    "subject": (('between = ["anna", "ben"]', 'between = ["anna", "carl"]'), "segments[0].between"),
}  # fmt: skip


@pytest.mark.parametrize("what", SAID)
def test_spoilt_scene_files(refused: Callable[..., str], what: str) -> None:
    change, expected = SAID[what]
    sentence = refused(change)
    assert sentence.startswith("JOB/scene.toml: ") and "expected " in sentence and "found " in sentence
    named = expected.replace("segments[0].", 'segments[0] "raise".').removesuffix(" ")
    assert expected in sentence or named in sentence, sentence


def test_a_part_that_is_empty_in_one_frame(refused: Callable[..., str], folder: Path) -> None:
    rows = (folder / "anna.csv").read_text().splitlines()
    rows = ["4,hand,9,9,9" if row.startswith("4,hand") else row for row in rows]
    (folder / "anna.csv").write_text("\n".join(rows))
    assert refused() == 'anna, segment "raise": expected part "hand" to hold some of the subject, found none in frame 4'


def test_a_part_that_is_empty_in_some_frames(refused: Callable[..., str], folder: Path) -> None:
    rows = (folder / "ben.csv").read_text().splitlines()
    rows = [f"{row.split(',')[0]},hand,9,9,9" if row.startswith(("11,hand", "12,hand")) else row for row in rows]
    (folder / "ben.csv").write_text("\n".join(rows))
    found = 'ben, segment "lower": expected part "hand" to hold some of the subject, found none in frame 11 and 1 more'
    assert refused() == found


@pytest.mark.parametrize("part", [BOX.replace("CENTRE", "5, 5, 5"), "hand = {label = 3}"])
def test_a_part_that_is_empty_in_all_frames(refused: Callable[..., str], part: str) -> None:
    found = refused((TRACKED, part))
    assert 'part "hand"' in found or "part" in found
    assert "found " in found and ("every frame" in found or "label" in found), found


@pytest.mark.parametrize("kind", ["folder", "binary", "missing"])
def test_no_scene_file(mhvedit: Command, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "scene.toml"
    if kind == "folder":
        path.mkdir()
    elif kind == "binary":
        path.write_bytes(b"\xff\xfe\x00" * 40)
    ran = mhvedit("solve", path, "-o", tmp_path / "out")
    assert ran.code == 2 and ran.sentence.startswith(f"{path}: scene file: expected ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "warning"),
    [
        ('units = "m"', 'warning: ben: 166 m tall: are its units cm? (units = "cm")'),
        ('up = "y"', "warning: ben: lies on its side, "),
    ],
)
def test_a_subject_that_is_too_large_or_on_its_side_is_warned_of(
    mhvedit: Command, folder: Path, options: str, warning: str
) -> None:
    """And the job goes on, whatever comes of it."""
    shutil.rmtree(folder / "ben")
    write_actor(folder, "ben", ANNA, scale=100.0 if "units" in options else 1.0)
    coarse = ("voxel = 0.04\nstep = 0.04", "voxel = 0.8\nstep = 0.8") if "units" in options else ("15", "15")
    write_scene(folder, ('path = "ben"\n', f'path = "ben"\n{options}\n'), coarse, (PARTS + '"hand", ben = "hand"}', ""))
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    assert ran.code in (0, 1), ran.err
    assert ran.err.startswith(warning) and "Traceback" not in ran.err
    assert json.loads((folder / "out" / "report.json").read_text())["warnings"]


def test_a_subject_that_does_not_fit_into_memory(mhvedit: Command, folder: Path) -> None:
    shutil.rmtree(folder / "ben")
    write_actor(folder, "ben", ANNA, scale=1000.0)
    write_scene(folder, (PARTS + '"hand", ben = "hand"}', ""))
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    warned, said = ran.err.splitlines()
    assert ran.code == 2 and 'are its units mm? (units = "mm")' in warned
    assert "search.voxel: expected at least" in said and "as ben takes" in said and "found 0.04" in said
    assert files_of(folder / "out") == {}


def test_a_window_too_small_for_the_bodies(mhvedit: Command, folder: Path) -> None:
    for window, words in (
        ("0.2", "the window is too small for the bodies to stand side by side: try search.window = "),
        ("0.0001", "the window holds no pose at all: enlarge search.window"),
    ):
        everywhere, here = (
            ("window = 2.4", f"window = {window}"),
            ('name = "raise"', f'name = "raise"\nwindow = {window}'),
        )
        for change, said in ((everywhere, words), (here, words.replace("search.window", "window"))):
            write_scene(folder, change)
            ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
            assert ran.code == 1, window
            assert said in ran.out, ran.out


def test_nothing_fits(mhvedit: Command, folder: Path, searches: list[int]) -> None:
    """A hand that moves cannot touch one that rests all the time: the files say so, and what would let it pass."""
    held = RAISE_TABLE.replace('"+&+"', '"0&0a"').replace("ben = [0, 6]", "ben = [7, 8]")
    write_scene(folder, (RAISE_TABLE, held), ("ben = [9, 15]", "ben = [10, 15]"), ("radius = 0.12", "radius = 0.06"))
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out")
    assert ran.code == 1
    assert set(files_of(folder / "out")) == {
        "report.html", "report.json", "scene.json", "solutions/raise.npz", "solutions/lower.npz",
    }  # fmt: skip
    report = json.loads((folder / "out" / "report.json").read_text())
    assert not report["solved"] and report["failure"] in ran.out
    empty = [segment for segment in report["segments"] if not segment["solutions"]]
    assert empty
    for segment in empty:
        assert segment["killed_by"] in segment["rejected"] and segment["poses_that_got_that_far"] > 0
        assert " solutions" in segment["nearest"] and segment["nearest"] in ran.out
        setting = segment["nearest"].split("with ")[1].split(" ")[0]
        assert setting in ("tolerance.frames", "tolerance.voxels", "tolerance.depth")
        with np.load(folder / "out" / "solutions" / f"{segment['name']}.npz") as kept:
            assert len(kept["x"]) == 0 and not (kept["reason"] == 0).any()
        assert segment["nearest"].split(" poses")[0].split()[-1] in (folder / "out" / "report.html").read_text()
    searches.clear()
    assert mhvedit("solve", folder / "scene.toml", "-o", folder / "out").code == 1
    assert searches == []


def test_adjoining_segments_with_nothing_in_common(mhvedit: Command, folder: Path) -> None:
    shutil.rmtree(folder / "ben")
    write_actor(folder, "ben", replace(BEN, left_from=7))
    changed = LOWER_TABLE.replace("{anna = [9, 15], ben = [9, 15]}", "{anna = [7, 15], ben = [7, 15]}")
    write_scene(folder, (LOWER_TABLE, changed))
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    assert ran.code == 1
    assert not (folder / "out" / "edit.json").exists()
    assert set(files_of(folder / "out")) == {
        "report.json", "scene.json", "solutions/raise.npz", "solutions/lower.npz",
    }  # fmt: skip
    said = '"raise" and "lower" adjoin, so they must share one placement, and have none in common'
    assert said in ran.out
    report = json.loads((folder / "out" / "report.json").read_text())
    assert not report["solved"] and report["failure"] == said
    assert all(segment["solutions"] for segment in report["segments"])


def test_an_earlier_answer_goes_where_there_is_none_now(mhvedit: Command, folder: Path) -> None:
    solve = ("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    assert mhvedit(*solve).code == 0
    write_scene(folder, ("window = 2.4", "window = 0.2"))
    assert mhvedit(*solve).code == 1
    assert not (folder / "out" / "edit.json").exists()
    checked = mhvedit("check", folder / "out")
    assert (checked.code, checked.err) == (1, "")
    assert checked.out == f'{folder / "out"}: no answer: "raise" has no solution; see report.json\n'
