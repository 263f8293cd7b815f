"""`mhvedit avoid` on cuts of real motions, judged by other code (tests/collision/independent.py)."""

import json
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.avoid import AvoidOptions, Method, method_of, run_avoid
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
    with pytest.raises(ShapeError, match="LeftHand"):
        run_avoid(path, tmp_path / "out", options=AvoidOptions(frozen=("Tail",)))
    with pytest.raises(CaptureError, match="no --body"):
        run_avoid(path, tmp_path / "out", options=AvoidOptions(body=path))
    assert not (tmp_path / "out").exists()
