"""A folder of `mhvedit avoid` in the viewer."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.pipeline.avoid import AvoidOptions, AvoidOutcome, run_avoid
from mhvedit.pipeline.folders import is_motion_folder
from mhvedit.pipeline.posture_file import POSTURES, Take, posed, postures_of, read_postures, write_postures
from mhvedit.skeleton.bvh_motion import bvh_of, write_bvh_motion
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import posed_vertices
from mhvedit.view.studio import camera_axes
from mhvedit.viewer.motion import (
    CHANGES,
    MotionState,
    Side,
    next_collision,
    open_motion_folder,
    started,
    status,
)
from mhvedit.viewer.motion3d import stand_of
from mhvedit.viewer.motion_shot import motion_shot
from mhvedit.viewer.motion_strip import HEIGHT, depth_colours, strip_picture
from mhvedit.viewer.state import advanced, at_frame
from mhvedit.viewer.timeline import x_of
from tests.avoidance.figures import figure
from tests.avoidance.scenes import rise
from tests.pipeline.toy import Ran
from tests.viewer.needed import ran_on_screen

SIZE = (640, 480)
WAITS = 30  # frames before it moves


@pytest.fixture(scope="session")
def avoided(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, AvoidOutcome]:
    """A figure that lies still, then rises with its arm through a thigh, freed; not to be written into."""
    folder = tmp_path_factory.mktemp("avoided")
    moves = rise()
    waits = Motion(np.concatenate([np.repeat(moves.q[:1], WAITS, axis=0), moves.q]), moves.fps)
    write_bvh_motion(folder / "rise.bvh", bvh_of(figure(), waits), waits)
    return folder / "out", run_avoid(folder / "rise.bvh", folder / "out", options=AvoidOptions(report=False))


@pytest.fixture(scope="session")
def motion(avoided: tuple[Path, AvoidOutcome]) -> MotionState:
    return started(open_motion_folder(avoided[0]))


def test_a_folder_shows_what_was_found(avoided: tuple[Path, AvoidOutcome], motion: MotionState) -> None:
    found, postures = avoided[1].found, motion.material.postures
    body, before = found.body, found.depths[0].depth - found.body.rest_depth
    frame = motion.frame
    assert frame == int(before.max(1).argmax())
    assert postures.touched.tolist() == [f in avoided[1].report["touched"] for f in range(postures.n_frames)]
    for take, q in ((Take.CAPTURED, found.problem.captured.q), (Take.EDITED, found.avoided.motion.q)):
        assert posed(postures, take, frame) == pytest.approx(posed_vertices(body.body, q[frame]), abs=1e-5)
    pair = int(before[frame].argmax())
    deep = {str(postures.limb_names[limb]) for limb in np.flatnonzero(postures.depth[0, frame] >= 999 * before.max())}
    assert deep == {body.limbs.names[limb] for limb in body.pairs.limbs[pair]}
    owner = body.body.weights[postures.faces].sum(1).argmax(1)
    assert [body.body.skeleton.names[joint] for joint in owner] == postures.limb_names[postures.limb].tolist()


def test_a_motion_far_from_the_origin_is_shown_as_near_it(
    avoided: tuple[Path, AvoidOutcome], motion: MotionState
) -> None:
    found = avoided[1].found
    away = np.zeros(found.problem.captured.q.shape[1])
    away[:2] = 500000.0, -300000.0
    captured = replace(found.problem.captured, q=found.problem.captured.q + away)
    edited = replace(found.avoided.motion, q=found.avoided.motion.q + away)
    far = replace(
        found, problem=replace(found.problem, captured=captured), avoided=replace(found.avoided, motion=edited)
    )
    there, near = postures_of(far), motion.material.postures
    moved = posed(there, Take.CAPTURED, 0)[0] - posed(near, Take.CAPTURED, 0)[0]
    assert np.abs(moved - np.round(moved)).max() < 1e-6 and np.abs(moved).max() < 5
    for take in Take:
        for frame in (0, motion.frame):
            assert posed(there, take, frame) - moved == pytest.approx(posed(near, take, frame), abs=1e-6)


def test_words_tell_limbs_and_depth(avoided: tuple[Path, AvoidOutcome], motion: MotionState) -> None:
    lines = status(motion)
    assert lines[0] == "rise, freed by bisection: all frames are free"
    assert f"frame {motion.frame}, touched" in lines
    deepest = avoided[1].found.metrics.deepest_before_mm
    assert lines[2] == f"before: left_forearm and left_thigh, {deepest:.1f} mm deeper than at rest"
    assert "as it was captured" in status(at_frame(motion, 0))[1]


def test_collisions_are_visited_round_and_round(motion: MotionState) -> None:
    depth = np.zeros_like(motion.material.postures.depth)
    depth[0, [2, 3, 8, 9, 15], 0] = 50
    material = replace(motion.material, postures=replace(motion.material.postures, depth=depth))
    now = MotionState(material, position=2.0)
    ahead = [now := next_collision(now, 1) for _ in range(3)]
    assert [state.frame for state in ahead] == [8, 15, 2]
    assert next_collision(at_frame(now, 9), -1).frame == 8
    assert next_collision(at_frame(now, 8), -1).frame == 2
    assert next_collision(at_frame(now, 0), -1).frame == 15
    assert next_collision(at_frame(now, 0), 1).frame == 2
    free = replace(material, postures=replace(material.postures, depth=0 * depth))
    assert next_collision(MotionState(free), 1).frame == 0


def test_it_plays_at_its_own_rate_and_every_key_changes_something(motion: MotionState) -> None:
    start = replace(at_frame(motion, 3), playing=True)
    assert advanced(start, 0.1).frame == 3 + round(0.1 * motion.material.fps)
    for key, (change, _) in CHANGES.items():
        changed = change(replace(at_frame(motion, 3), side=Side.NEAR if key in "23" else Side.TOP))
        assert (changed.position, changed.playing, changed.speed, changed.loop, changed.side) != (
            3.0, False, 1.0, True, Side.NEAR if key in "23" else Side.TOP,
        ), key  # fmt: skip


def test_a_limb_is_coloured_from_the_limit_on() -> None:
    colours = depth_colours(np.array([0.0, 4.9, 5.1, 30.0, 60.0, 90.0]), limit=5.0, top=60.0).astype(int)
    assert (colours[0] == colours[1]).all() and colours[0, 2] > colours[0, 0]
    assert (colours[2:, 0] > colours[2:, 2]).all()
    assert (np.diff(colours[2:].sum(1)) <= 0).all() and (colours[4] == colours[5]).all()


@pytest.mark.parametrize("side", Side)
def test_the_body_after_is_right_of_the_one_before(motion: MotionState, side: Side) -> None:
    stand = stand_of(motion.material, side)
    axes = camera_axes(stand.look, stand.up)
    assert stand.apart @ axes[:, 1:] == pytest.approx(np.zeros(2), abs=1e-9)
    half = len(stand.cloud) // 2
    assert (stand.cloud[:half] @ axes[:, 0]).max() < (stand.cloud[half:] @ axes[:, 0]).min()


def reddish(picture: ByteArray) -> BoolArray:
    return np.asarray(picture[..., 0].astype(int) - picture[..., 2] > 50)


def test_a_shot_shows_the_collision_before_and_none_after(motion: MotionState) -> None:
    above = SIZE[1] - HEIGHT
    colliding, free = (motion_shot(state, size=SIZE) for state in (motion, at_frame(motion, 0)))
    left, right = np.s_[:above, : SIZE[0] // 2], np.s_[:above, SIZE[0] // 2 :]
    assert colliding.shape == (SIZE[1], SIZE[0], 3)
    assert all(len(np.unique(colliding[part].reshape(-1, 3), axis=0)) > 30 for part in (left, right))
    assert reddish(colliding[left]).sum() > 50
    assert reddish(colliding[right]).sum() == 0 == reddish(free[:above]).sum()
    assert (colliding[:above] != free[:above]).any(-1).mean() > 0.02


def test_a_frame_that_was_not_touched_looks_the_same_on_both_sides(motion: MotionState) -> None:
    picture = motion_shot(at_frame(motion, 0), size=SIZE)[60 : SIZE[1] - HEIGHT]
    body = picture[..., 2].astype(int) - picture[..., 0] > 40
    n_left, n_right = body[:, : SIZE[0] // 2].sum(), body[:, SIZE[0] // 2 :].sum()
    assert n_left > 500 and n_right == pytest.approx(n_left, rel=0.03)


def test_the_strip_marks_touched_frames_and_where_it_is(motion: MotionState) -> None:
    n, touched = motion.material.n_frames, motion.material.postures.touched
    assert touched.any() and not touched.all()
    strip = strip_picture(at_frame(motion, 0), width=800, height=HEIGHT)
    band = [tuple(strip[HEIGHT - 6, int(x_of(frame + 0.5, 800, n))]) for frame in range(1, n)]
    assert len({colour for colour, mark in zip(band, touched[1:], strict=True) if mark}) == 1
    assert len(set(band)) == 2
    moved = strip_picture(motion, width=800, height=HEIGHT)
    columns = np.flatnonzero((moved != strip).any(-1)[30:].any(0))
    assert columns.max() == pytest.approx(x_of(motion.frame + 0.5, 800, n), abs=2)


def test_postures_come_back_from_their_file(motion: MotionState, tmp_path: Path) -> None:
    write_postures(tmp_path / POSTURES, motion.material.postures)
    again = read_postures(tmp_path / POSTURES)
    for name in ("faces", "limb_names", "rotations", "depth", "touched", "limit"):
        assert (getattr(again, name) == getattr(motion.material.postures, name)).all()


def test_what_is_no_such_folder_is_said(avoided: tuple[Path, AvoidOutcome], tmp_path: Path) -> None:
    assert not is_motion_folder(tmp_path) and not is_motion_folder(tmp_path / "none")
    with pytest.raises(CaptureError, match="an output folder of `mhvedit avoid`"):
        open_motion_folder(tmp_path)
    out = Path(shutil.copytree(avoided[0], tmp_path / "out"))
    content = (out / POSTURES).read_bytes()
    (out / POSTURES).write_bytes(content[: len(content) // 2])
    with pytest.raises(CaptureError, match=r"postures.npz: .*`mhvedit avoid` writes them, found a file that is da"):
        open_motion_folder(out)
    (out / POSTURES).unlink()
    with pytest.raises(CaptureError, match="`mhvedit avoid` writes them, found No such file"):
        open_motion_folder(out)
    (out / POSTURES).write_bytes(content)
    report = json.loads((out / "report.json").read_text())
    (out / "report.json").write_text(json.dumps(report | {"frames": 7}))
    with pytest.raises(CaptureError, match=r"expected the 7 frames of report.json, found 54 frames"):
        open_motion_folder(out)


def test_the_command_draws_a_frame(
    mhvedit: Callable[..., Ran], avoided: tuple[Path, AvoidOutcome], tmp_path: Path
) -> None:
    file = tmp_path / "a.png"
    ran = mhvedit("view", avoided[0], "--shot", file, "--frame", 0)
    assert (ran.code, ran.out, ran.err) == (0, f"drawn {file}\n", "")
    assert np.asarray(Image.open(file)).std() > 10


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--shot", "a.png", "--frame", "54"), "--frame: expected a frame from 0 to 53, found 54"),
        (("--segment", "raise"), "--segment: expected a scene, which has segments, found the motion"),
        (("--web",), "--web: expected a scene; a motion is shown in a window or by --shot FILE.png"),
    ],
)
def test_what_the_command_refuses(
    mhvedit: Callable[..., Ran],
    avoided: tuple[Path, AvoidOutcome],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = mhvedit("view", avoided[0], *words)
    assert ran.code == 2 and sentence in ran.sentence
    assert not list(tmp_path.iterdir())


SCRIPT = """
import sys
from pathlib import Path
import pyvista
from PIL import Image
from mhvedit.viewer.motion import open_motion_folder, started
from mhvedit.viewer.motion_desktop import MotionWindow

plotter = pyvista.Plotter(off_screen=False, window_size=(1000, 640), lighting="none")
window = MotionWindow(started(open_motion_folder(Path(sys.argv[1]))), plotter)
window.refresh()
plotter.show(interactive_update=True, auto_close=False)
iren = plotter.iren.interactor


def take(name):
    for _ in range(3):
        window.tick(0.0)
        plotter.iren.process_events()
    Image.fromarray(plotter.screenshot(return_img=True)).save(Path(sys.argv[2]) / f"{name}.png")


def key(name):
    iren.SetKeySym(name)
    iren.InvokeEvent("KeyPressEvent")
    iren.InvokeEvent("CharEvent")


take("first")
iren.SetEventInformation(20, 40)
iren.InvokeEvent("LeftButtonPressEvent")
iren.InvokeEvent("LeftButtonReleaseEvent")
assert window.state.frame == 0, window.state.frame
take("clicked")
key("space")
window.tick(0.2)
assert window.state.frame > 0
key("space")
key("3")
take("above")
key("q")
assert not window.open
plotter.close()
"""


def test_a_window_shows_it_and_answers_keys_and_mouse(avoided: tuple[Path, AvoidOutcome], tmp_path: Path) -> None:
    script = tmp_path / "window.py"
    script.write_text(SCRIPT)
    ran = ran_on_screen(script, avoided[0], tmp_path)
    assert ran.returncode == 0, ran.stderr
    first, clicked, above = (np.asarray(Image.open(tmp_path / f"{n}.png")) for n in ("first", "clicked", "above"))
    bodies, strip = np.s_[100 : 640 - HEIGHT], np.s_[640 - HEIGHT + 30 :]
    assert reddish(first[bodies]).sum() > 100 and reddish(clicked[bodies]).sum() == 0
    assert (first[strip] != clicked[strip]).any()
    assert (above[bodies] != clicked[bodies]).any(-1).mean() > 0.02
