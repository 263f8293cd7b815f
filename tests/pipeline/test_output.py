"""The output folder, as the contract has it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.planar import compose, invert, wrap_angle
from mhvedit.pipeline.run import Outcome
from tests.pipeline.toy import N_FRAMES, files_of

JUDGE = Path(__file__).resolve().parents[2].parent / "shared" / "tools" / "judge.py"
Solved = tuple[Path, Outcome]


def test_the_files(solved: Solved) -> None:
    out, _ = solved
    assert set(files_of(out)) == {
        "edit.json",
        "report.json",
        "scene.json",
        "solutions/raise.npz",
        "solutions/lower.npz",
    }
    assert not [p for p in out.rglob("*") if p.name.endswith((".part", ".tmp")) or p.name == ".new"]


def test_the_edit(solved: Solved) -> None:
    edit = json.loads((solved[0] / "edit.json").read_text())
    assert list(edit) == [
        "version", "name", "fps", "frames", "subjects", "segments", "cost", "lower_bound", "gap",
    ]  # fmt: skip
    assert (edit["version"], edit["name"], edit["fps"], edit["frames"]) == (1, "toy", 30.0, N_FRAMES)
    for subject in edit["subjects"].values():
        assert list(subject) == ["source", "x", "y", "yaw"]
        assert subject["source"] == list(range(N_FRAMES))
        assert all(len(subject[key]) == N_FRAMES and np.isfinite(subject[key]).all() for key in ("x", "y", "yaw"))
    assert [(s["name"], s["start"], s["stop"]) for s in edit["segments"]] == [("raise", 0, 7), ("lower", 9, 16)]
    for segment in edit["segments"]:
        assert list(segment) == ["name", "start", "stop", "interaction", "between", "solution", "relative"]
        assert segment["between"] == ["anna", "ben"]
        assert list(segment["solution"]) == ["distance", "theta_a", "theta_b"]
        assert list(segment["relative"]) == ["x", "y", "yaw"]


def test_a_segment_stands_as_its_relative_says(solved: Solved) -> None:
    edit = api.read_edit(solved[0] / "edit.json")
    for segment in edit.segments:
        a, b = (edit.subjects[name].placements[segment.start : segment.stop] for name in segment.between)
        error = compose(invert(a), b) - segment.relative
        np.testing.assert_allclose(error[:, :2], 0, atol=1e-9)
        np.testing.assert_allclose(wrap_angle(error[:, 2]), 0, atol=1e-9)


def test_the_solutions(solved: Solved) -> None:
    out, outcome = solved
    edit = json.loads((out / "edit.json").read_text())
    for segment, told in zip(edit["segments"], outcome.report["segments"], strict=True):
        with np.load(out / "solutions" / f"{segment['name']}.npz") as kept:
            found = dict(kept)
        count = told["solutions"]
        assert count > 0
        for key in ("x", "y", "yaw", "distance", "theta_a", "theta_b", "region"):
            assert found[key].shape == (count,), key
        assert found["region"].dtype.kind == "i" and found["reason"].dtype == np.uint8
        axes = [found[f"axes_{axis}"] for axis in ("x", "y", "yaw")]
        assert found["reason"].shape == tuple(map(len, axes))
        assert all((np.diff(axis) > 0).all() for axis in axes)
        assert found["reasons"][0] == "accepted" and (found["reason"] == 0).sum() == count
        assert found["reason"].max() < len(found["reasons"])
        row = told["chosen"]["row"]
        for key in ("x", "y", "yaw"):
            assert found[key][row] == pytest.approx(segment["relative"][key], abs=1e-9)
        for key in ("distance", "theta_a", "theta_b"):
            assert found[key][row] == pytest.approx(segment["solution"][key], abs=1e-9)


def test_a_solution_is_told_twice_and_says_the_same(solved: Solved) -> None:
    """Distance and both angles, measured on the captures' facings and roots, agree with the transforms."""
    out, outcome = solved
    a, b = (outcome.result.people[name] for name in ("anna", "ben"))
    segment = outcome.result.segment("raise")
    grid = segment.found.grid
    root_a, root_b = (compose(p.pose, np.append(root, 0.0)) for p, root in ((a, grid.root_a), (b, grid.root_b)))
    facing_a, facing_b = (p.facing_over(n) for p, n in ((a, segment.pair.a), (b, segment.pair.b)))
    with np.load(out / "solutions" / "raise.npz") as found:
        relative = np.stack([found["x"], found["y"], found["yaw"]], 1)
        towards = compose(relative, root_b)[:, :2] - root_a[:2]
        bearing = np.arctan2(towards[:, 1], towards[:, 0])
        np.testing.assert_allclose(np.linalg.norm(towards, axis=1), found["distance"], atol=1e-9)
        np.testing.assert_allclose(wrap_angle(bearing - facing_a - found["theta_a"]), 0, atol=1e-9)
        back = bearing + np.pi - relative[:, 2] - facing_b
        np.testing.assert_allclose(wrap_angle(back - found["theta_b"]), 0, atol=1e-9)


def test_the_report(solved: Solved) -> None:
    report = json.loads((solved[0] / "report.json").read_text())
    assert report["solved"] and report["failure"] is None and report["cost"] == 0.0
    assert report["check"]["frames"] == N_FRAMES
    assert report["problems"] == [] and report["estimated"] == {"anna": [], "ben": []}
    for segment in report["segments"]:
        cells = (solved[1].result.segment(segment["name"]).found.reason).size
        assert segment["solutions"] + sum(segment["rejected"].values()) == cells


@pytest.mark.skipif(not JUDGE.exists(), reason="no shared tools")
def test_the_judge_accepts(solved: Solved, captures: Path) -> None:
    judged = subprocess.run(
        [sys.executable, JUDGE, captures / "scene.toml", solved[0], "--stride", "1"], capture_output=True, text=True
    )
    assert judged.returncode == 0, judged.stdout + judged.stderr
    raised, lowered, scene = (json.loads(line) for line in judged.stdout.splitlines())
    assert raised["part_touch"].endswith("#") and lowered["part_touch"].startswith("#")
    assert scene["frames"] == N_FRAMES and scene["cost"] == 0.0
