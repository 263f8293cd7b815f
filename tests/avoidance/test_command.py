"""`mhvedit avoid` on cuts of real motions, judged by other code (tests/collision/independent.py)."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.avoid import AvoidOptions, Method, method_of, run_avoid
from mhvedit.pipeline.motions import open_motion
from mhvedit.skeleton.bvh_motion import bvh_of, write_bvh_motion
from tests.avoidance.figures import figure
from tests.avoidance.scenes import walk
from tests.collision import independent
from tests.skeleton.shared_motions import shared_motion

CUTS = {"walk_throw_heavy": range(524, 540), "prone_hold_heavy": range(240, 256)}
STANDS = 0.1  # m/s


def cut(name: str, folder: Path, frames: range) -> Path:
    """Some frames of a shared motion."""
    stored = dict(np.load(shared_motion(name)))
    for key in ("rotations", "positions"):
        stored[key] = stored[key][frames.start : frames.stop]
    path = folder / f"{name}.npz"
    np.savez(path, **stored)
    return path


def deepest(path: Path) -> float:
    """m deeper than at rest, by the independent check."""
    stored = dict(np.load(path))
    pieces = independent.cut(stored)
    rest = independent.rest_depths(stored, pieces)
    frames = range(0, len(stored["rotations"]), 3)
    return float(max((independent.depths(pieces, independent.posed(stored, f)) - rest).max() for f in frames))


def feet(stored: dict[str, FloatArray]) -> FloatArray:
    return stored["positions"][:, [i for i, n in enumerate(stored["joints"]) if "Foot" in str(n) or "Toe" in str(n)]]


@pytest.mark.parametrize("name", CUTS)
def test_a_real_motion_is_freed(name: str, tmp_path: Path) -> None:
    path, out = cut(name, tmp_path, CUTS[name]), tmp_path / "out"
    outcome = run_avoid(path, out, options=AvoidOptions(report=False))
    assert outcome.found.avoided.converged
    assert outcome.found.why == ()
    assert deepest(path) > 0.005
    assert deepest(out / "motion.npz") < 0.005
    before, after = dict(np.load(path)), dict(np.load(out / "motion.npz"))
    speed = np.linalg.norm(np.diff(feet(before), axis=0), axis=2) * float(before["fps"])
    moved = np.linalg.norm(feet(after) - feet(before), axis=2)[1:]
    assert moved[(speed < STANDS) & (feet(before)[1:, :, 2] < 0.15)].max(initial=0.0) < 0.005
    assert outcome.found.metrics.step_ratio <= 1.5
    report = json.loads((out / "report.json").read_text())
    assert report["converged"] is True
    assert len(report["joint_change"]) == len(CUTS[name])
    for frame in set(range(len(CUTS[name]))) - set(report["touched"]):
        assert (after["rotations"][frame] == before["rotations"][frame]).all()
    pair = max(report["pairs"], key=lambda row: max(row["before_mm"]) - row["rest_mm"])
    assert max(pair["after_mm"]) < pair["rest_mm"] + 5
    assert {"limbs", "rest_mm", "before_mm", "after_mm"} <= set(pair)


def test_the_page_shows_the_body_before_and_after(tmp_path: Path) -> None:
    path = cut("walk_throw_heavy", tmp_path, range(530, 534))
    run_avoid(path, tmp_path / "out", options=AvoidOptions(method=Method.NEBEL))
    page = (tmp_path / "out" / "report.html").read_text()
    assert "walk_throw_heavy" in page
    assert "http" not in page.replace("http-equiv", "")
    assert page.count("data:image/webp") >= 1


def stride(path: Path, *, units: str = "m", up: str = "z", n_frames: int = 8) -> Path:
    """A person who walks on the spot, as a BVH."""
    take = bvh_of(figure(), walk(n_frames), units=units, up=up)
    write_bvh_motion(path, take, take.motion)
    return path


@pytest.mark.parametrize(
    ("written", "read", "said"),
    [
        (("m", "z"), ("m", "z"), None),
        (("cm", "y"), ("cm", "y"), None),
        (("cm", "z"), ("m", "z"), r"1\d\d m tall: are its units cm\? \(--units cm\)"),
        (("m", "z"), ("cm", "z"), r"0\.01\d+ m tall: are its units m\? \(--units m\)"),
        (("m", "y"), ("m", "z"), r"lies on its side, 0\.\d\d m high: is its up axis y\? \(--up y\)"),
        (("m", "z"), ("m", "y"), r"lies on its side, 0\.\d\d m high: is its up axis z\? \(--up z\)"),
    ],
)
def test_units_and_axes_of_a_bvh_that_make_no_person_are_doubted(
    written: tuple[str, str], read: tuple[str, str], said: str | None, tmp_path: Path
) -> None:
    path = stride(tmp_path / "walk.bvh", units=written[0], up=written[1])
    doubts = open_motion(path, units=read[0], up=read[1]).doubts
    assert len(doubts) == (said is not None)
    if said is not None:
        assert re.fullmatch(re.escape(f"{path}: ") + said, doubts[0])


def test_a_person_of_no_known_unit_is_doubted(tmp_path: Path) -> None:
    """Some export three units a metre."""
    take = bvh_of(replace(figure(), offsets=figure().offsets * 3), walk(4))
    write_bvh_motion(tmp_path / "tall.bvh", take, take.motion)
    (doubt,) = open_motion(tmp_path / "tall.bvh").doubts
    assert "people are 0.5 to 2.5 m" in doubt


def test_a_doubt_is_told_at_once_and_is_in_the_report(tmp_path: Path) -> None:
    path, told = stride(tmp_path / "walk.bvh", n_frames=2), list[str]()
    options = AvoidOptions(units="cm", report=False)
    report = run_avoid(path, tmp_path / "out", options=options, warn=told.append).report
    assert len(told) == 1 and "are its units m?" in told[0]
    assert told[0] in json.loads((tmp_path / "out" / "report.json").read_text())["notes"] == report["notes"]


def test_bad_input_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"\.npz or \.bvh"):
        run_avoid(tmp_path / "walk.fbx", tmp_path / "out", options=AvoidOptions())
    with pytest.raises(CaptureError, match="skinned motion"):
        run_avoid(tmp_path / "none.npz", tmp_path / "out", options=AvoidOptions())
    with pytest.raises(ShapeError, match="filter, bisection, nebel"):
        method_of("magic")
    path = cut("walk_throw_heavy", tmp_path, range(530, 532))
    with pytest.raises(ShapeError, match="MESH:LIMB"):
        run_avoid(path, tmp_path / "out", options=AvoidOptions(attached=("sword.obj",)))
    with pytest.raises(ShapeError, match=r"^--freeze: expected one of Hips.*LeftHand.*, found 'Tail'"):
        run_avoid(path, tmp_path / "out", options=AvoidOptions(frozen=("Tail",)))
    with pytest.raises(CaptureError, match="no --body"):
        run_avoid(path, tmp_path / "out", options=AvoidOptions(body=path))
    assert not (tmp_path / "out").exists()
