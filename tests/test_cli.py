"""The command line: what it prints, and the code that it leaves with."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mhvedit import __version__, api
from mhvedit.pipeline.run import Outcome
from tests.pipeline.conftest import captures, folder, measured, mhvedit, solved, unmeasured
from tests.pipeline.test_bad_input import Command
from tests.pipeline.toy import N_FRAMES, write_scene

__all__ = ["captures", "folder", "measured", "mhvedit", "solved", "unmeasured"]  # fixtures
Solved = tuple[Path, Outcome]


def test_the_installed_command(captures: Path, tmp_path: Path) -> None:
    """A process of its own, with the report drawn."""
    command = Path(sys.executable).with_name("mhvedit")
    words = [str(command), "solve", str(captures / "scene.toml"), "-o", str(tmp_path / "out"), "--workers", "1"]
    ran = subprocess.run(words, capture_output=True, text=True)
    assert ran.returncode == 0 and ran.stderr == "", ran.stderr
    assert f"{N_FRAMES} frames, cost 0 m² (gap 0 %)\ndeepest penetration " in ran.stdout
    assert ran.stdout.endswith(f"open {tmp_path / 'out' / 'report.html'}\n")
    page = (tmp_path / "out" / "report.html").read_text()
    assert "raise" in page and "lower" in page and "http://" not in page.replace("http://www.w3.org", "")


def test_solve_in_words(mhvedit: Command, folder: Path, unmeasured: None) -> None:
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    assert ran.code == 0 and ran.err == ""
    raised, lowered, scene, checked, *_, last = ran.out.splitlines()
    assert raised.startswith("raise  +&+  ") and raised.endswith(" placements in 1 region")
    assert lowered.startswith("lower  -&-  ")
    assert scene == f"{N_FRAMES} frames, cost 0 m² (gap 0 %)"
    assert checked.startswith("deepest penetration ")
    assert last == f"written to {folder / 'out'}"
    assert mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report").out == ran.out


def test_solve_as_json(mhvedit: Command, folder: Path, unmeasured: None) -> None:
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report", "--json")
    assert ran.code == 0
    assert json.loads(ran.out) == json.loads((folder / "out" / "report.json").read_text())


def test_a_failure_as_json(mhvedit: Command, folder: Path, unmeasured: None) -> None:
    write_scene(folder, ("window = 2.4", "window = 0.2"))
    ran = mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report", "--json")
    found = json.loads(ran.out)
    assert ran.code == 1 and not found["solved"] and found["segments"][0]["solutions"] == 0


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        ((), 0, "nothing passes a threshold"),
        (("--penetration", "30"), 1, "penetration: anna and ben are "),
        (("--skate", "-1"), 1, "skate: anna: "),
        (("--step", "-1"), 1, "step: anna: "),
        (("--turn", "-1"), 1, "turn: anna: "),
        (("--jump", "-1"), 1, "jump: anna: "),
    ],
)
def test_check(mhvedit: Command, solved: Solved, options: tuple[str, ...], code: int, said: str) -> None:
    ran = mhvedit("check", solved[0], *options)
    assert (ran.code, ran.err) == (code, "")
    first, *sentences = ran.out.splitlines()
    assert first.startswith(f"{N_FRAMES} frames, deepest penetration ")
    assert sentences[0].startswith(said)


def test_check_as_json(mhvedit: Command, solved: Solved) -> None:
    ran = mhvedit("check", solved[0], "--penetration", "30", "--between", "1", "--json")
    found = json.loads(ran.out)
    assert ran.code == 1
    assert found["frames"] == N_FRAMES and found["between_frames"] == 1 and len(found["problems"]) > 0
    assert [s["agrees"] for s in found["segments"]] == [True, True]


def test_check_of_bodies_that_somebody_pushed_together(mhvedit: Command, folder: Path) -> None:
    out = folder / "out"
    api.write(api.solve(api.load(folder / "scene.toml")), out)
    edit = json.loads((out / "edit.json").read_text())
    edit["subjects"]["ben"] |= {key: [0.0] * N_FRAMES for key in ("x", "y")}
    edit["subjects"]["anna"] |= {key: [0.0] * N_FRAMES for key in ("x", "y")}
    (out / "edit.json").write_text(json.dumps(edit))
    ran = mhvedit("check", out)
    assert (ran.code, ran.err) == (1, "")
    assert "contact: segment raise (anna and ben, frames 0-6): " in ran.out


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('name = "lower"', 'name = "sink"'),
        ("anna = [9, 15]", "anna = [9, 13]"),
        ('"-&-"', '"0&0b"'),
        ('between = ["anna", "ben"]', 'between = ["ben", "anna"]'),
    ],
)
def test_check_after_the_scene_file_changed(
    mhvedit: Command, folder: Path, unmeasured: None, old: str, new: str
) -> None:
    mhvedit("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    write_scene(folder, (old, new))
    ran = mhvedit("check", folder / "out")
    assert ran.code == 2
    assert ran.sentence == (
        f"{folder}/out/edit.json: expected the edit of {folder}/scene.toml as it is now, "
        "found an earlier one's: run `mhvedit solve` again"
    )


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("edit.json", "{}", "expected an edit written by `mhvedit solve`, found none that says 'version'"),
        ("edit.json", "[", "expected an edit written by `mhvedit solve`, found Expecting value: line 1"),
        ("edit.json", '{"version": 9}', "expected version 1, found version 9"),
        ("scene.json", "{}", "expected the scene file that `mhvedit solve` noted, found nothing readable"),
        ("scene.json", '{"scene": "elsewhere.toml"}', "expected a TOML file, found nothing"),
    ],
)
def test_check_of_a_damaged_folder(
    mhvedit: Command, solved: Solved, tmp_path: Path, name: str, content: str, said: str
) -> None:
    out = Path(shutil.copytree(solved[0], tmp_path / "out"))
    (out / name).write_text(content)
    ran = mhvedit("check", out)
    assert ran.code == 2 and said in ran.sentence
    assert (out / "elsewhere.toml" if "elsewhere" in content else out / name).name in ran.sentence


def test_check_of_nothing(mhvedit: Command, tmp_path: Path) -> None:
    ran = mhvedit("check", tmp_path / "out")
    assert ran.code == 2
    assert ran.sentence == f"{tmp_path}/out/edit.json: expected an edit written by `mhvedit solve`, found no such file"
    assert not (tmp_path / "out").exists()


def test_inspect(mhvedit: Command, captures: Path) -> None:
    ran = mhvedit("inspect", captures / "anna")
    assert ran.code == 0 and ran.err == ""
    assert ran.out.startswith("anna: folder of .obj files\n")
    for said in (
        "16, numbers 0 to 15, no gaps",
        "30 fps (assumed)",
        "m (guessed), z up (guessed)",
        "16 of 16",
    ):
        assert said in ran.out, said
    found = json.loads(mhvedit("inspect", captures / "anna", "--fps", "25", "--json").out)
    assert (found["fps"], found["fps_from"], found["watertight_frames"]) == (25, "given", 16)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("inspect", "nowhere"), "nowhere: expected a folder of numbered meshes, a .npz or a USD file, found nothing"),
        (("inspect", ".", "--units", "km"), "units: expected one of m, cm, mm, found 'km'"),
        (("inspect", ".", "--up", "w"), "up: expected one of x, y, z, found 'w'"),
        (("inspect", ".", "--fps", "0"), "Invalid value for '--fps'"),
        (("solve",), "Missing argument 'scene'."),
        (("solve", "scene.toml"), "Missing option '-o' / '--out'."),
        (("solve", "scene.toml", "-o", "out", "--workers", "0"), "Invalid value for '--workers'"),
        (("solve", "scene.toml", "-o", "out", "--speed"), "No such option: --speed"),
        (("sovle",), "No such command 'sovle'."),
    ],
)
def test_mistakes_on_the_command_line(mhvedit: Command, words: tuple[str, ...], said: str) -> None:
    ran = mhvedit(*words)
    assert ran.code == 2 and said in ran.sentence


def test_help_and_version(mhvedit: Command) -> None:
    assert mhvedit("version").out == f"{__version__}\n"
    asked = mhvedit("--help")
    assert asked.code == 0 and "solve" in asked.out
    nothing = mhvedit()
    assert nothing.code == 2 and nothing.err == "" and "solve" in nothing.out
