from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.errors import CaptureError
from mhvedit.pipeline.output import claimed
from mhvedit.project.scene_file import load_scene
from mhvedit.viewer.actions import act
from mhvedit.viewer.deciding import pinned, with_half_angle, with_tolerance
from mhvedit.viewer.session import Session, open_session
from mhvedit.viewer.state import Layer, looked_at_row, with_layer
from tests.pipeline.toy import Ran


def pin(session: Session, row: int) -> None:
    session.do(lambda now: looked_at_row(now, row))
    session.do(pinned)
    session.finish()


def chosen(session: Session) -> int | None:
    assert session.state.view is not None
    return session.state.view.chosen


def test_a_scene_file_begins_to_be_solved(folder: Path, result: api.Result) -> None:
    told: list[str] = []
    session = open_session(folder / "scene.toml", workers=1, tell=told.append)
    assert session.is_busy and session.state.view is None and told
    session.finish()
    assert result.assembly is not None
    assert session.message == "solved" and chosen(session) == result.assembly.chosen[0]
    assert session.state.material.notes == () and not session.stale
    session.close()


def test_a_pin_is_chosen_without_a_search(session: Session, searches: list[int]) -> None:
    pin(session, 40)
    searches.clear()
    pin(session, 100)
    assert chosen(session) == 100 and session.state.is_current and not session.state.is_saved
    assert not searches
    session.undo()
    session.finish()
    assert chosen(session) == 40
    session.redo()
    session.finish()
    assert chosen(session) == 100


def test_what_is_saved_survives(session: Session, folder: Path) -> None:
    pin(session, 40)
    act(session, "save")
    assert session.message == f"saved {session.job.scene.file} and {folder / 'out'}"  # type: ignore[union-attr]
    assert session.state.is_saved
    assert load_scene(folder / "scene.toml").segments[0].pin is not None
    again = open_session(folder / "out", workers=1)
    assert not again.stale and chosen(again) == 40 and again.state.decisions.keys() == session.state.decisions.keys()
    again.close()
    solved = api.solve(api.load(folder / "scene.toml"), workers=1)
    assert solved.assembly is not None and solved.assembly.chosen[0] == 40


def test_a_tolerance_waits_for_a_search(session: Session) -> None:
    before = session.state.view.n_solutions  # type: ignore[union-attr]
    tolerance = replace(session.state.decision.tolerance, voxels=2)  # type: ignore[union-attr]
    session.do(lambda now: with_tolerance(now, tolerance))
    assert not session.is_busy and session.state.needs_search
    session.solve()
    assert session.is_busy
    session.finish()
    assert session.state.view.n_solutions > before
    assert session.state.is_current


def test_a_decision_made_while_it_solves_is_not_lost(session: Session) -> None:
    session.solve()
    session.do(lambda now: looked_at_row(now, 40))
    session.do(pinned)
    session.finish()
    assert session.state.is_current and chosen(session) == 40


def test_nothing_that_fits_is_said_and_can_be_undone(session: Session) -> None:
    session.do(lambda now: with_half_angle(now, np.radians(0.5)))
    session.solve()
    session.finish()
    assert session.message.startswith("no answer: ") and not session.state.material.placed
    session.undo()
    session.solve()
    session.finish()
    assert session.state.material.placed and session.message == "solved"


def test_all_solutions_excluded_is_said(session: Session) -> None:
    act(session, "exclude region")
    session.finish()
    assert "`exclude` leaves none of its" in session.message
    act(session, "bring back")
    session.finish()
    assert session.state.material.placed


def test_saving_where_another_run_is_at_work(session: Session, folder: Path) -> None:
    pin(session, 40)
    with claimed(folder / "out"):
        session.save()
    assert session.message.startswith("not saved: ") and not session.state.is_saved
    session.save()
    assert session.state.is_saved


def test_volumes_are_made_when_they_are_asked_for(session: Session) -> None:
    assert session.volumes() is None
    session.do(lambda now: with_layer(now, Layer.VOLUMES, True))
    assert session.volumes() is None
    session.finish()
    made = session.volumes()
    assert made is not None and all(volume.filled.any() for volume in made)


def test_a_segment_that_is_not_there(session: Session) -> None:
    with pytest.raises(CaptureError, match=r"^--segment: expected one of raise, lower, found rise"):
        session.go_to_segment("rise")


def test_without_its_captures_nothing_can_be_decided(folder: Path) -> None:
    (folder / "ben.csv").unlink()
    session = open_session(folder / "out", workers=1)
    for action, words in (("pin", ""), ("solve", "nothing can be solved: "), ("save", "nothing can be saved: ")):
        act(session, action)
        assert session.message.startswith(words)
    assert "ben.csv" in session.message and not session.is_busy and session.state.is_saved
    session.close()


def test_a_picture_from_the_command_line(mhvedit: Callable[..., Ran], folder: Path) -> None:
    file = folder / "shot.png"
    ran = mhvedit("view", folder / "out", "--shot", file, "--segment", "lower")
    assert (ran.code, ran.out, ran.err) == (0, f"drawn {file}\n", "")
    assert file.stat().st_size > 10_000
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith((".shot", "shot"))) == ["shot.png"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("nothing", "--shot", "a.png"), "nothing: expected a scene file or an output folder of `mhvedit solve`"),
        (("out", "--shot", "a.txt"), "a.txt: expected a picture's name ending in .png, .webp, .jpg, .jpeg, found .txt"),
        (("out", "--shot", "a.png", "--segment", "x"), "--segment: expected one of raise, lower, found x"),
        (("out", "--shot", "none/a.png"), "none/a.png: expected a folder none to write into, found nothing there"),
        (("out", "--shot", "scene.toml/a.png"), "expected a folder scene.toml to write into, found a file"),
        (("out", "--web", "--host", "no.such.host.example"), "--host: expected an address of this machine"),
    ],
)
def test_what_the_command_refuses(
    mhvedit: Callable[..., Ran], folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], sentence: str
) -> None:
    monkeypatch.chdir(folder)
    ran = mhvedit("view", *words)
    assert ran.code == 2 and sentence in ran.sentence
    assert not (folder / "a.png").exists()


def test_without_a_screen_a_window_is_refused(
    mhvedit: Callable[..., Ran], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    ran = mhvedit("view", folder / "out")
    assert ran.code == 2 and "--web" in ran.sentence and "--shot" in ran.sentence
    assert ran.sentence.startswith("the viewer's window: expected a screen, found none: set DISPLAY")


def test_where_nothing_can_be_drawn_one_sentence_says_what_to_install(
    mhvedit: Callable[..., Ran], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mhvedit.view.studio._has_egl_device", lambda: False)
    monkeypatch.setattr("mhvedit.view.studio.has_screen", lambda: False)
    ran = mhvedit("view", folder / "out", "--shot", "a.png")
    assert ran.code == 2 and "apt-get install libegl1" in ran.sentence
