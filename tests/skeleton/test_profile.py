from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.skeleton.profile import HEADER, JointProfile, profile_from_splines, read_profile, write_profile

PROFILE = JointProfile(np.round(np.random.default_rng(0).normal(size=(4, 55)), 6), 0.033333, np.zeros(3))


def test_the_text_is_what_the_thesis_writes(tmp_path: Path) -> None:
    """B8.1: five comments, time, count, 55 numbers with six decimals and no trailing tab."""
    write_profile(tmp_path / "a.txt", PROFILE)
    lines = (tmp_path / "a.txt").read_text().splitlines()
    assert tuple(lines[:5]) == HEADER
    assert lines[5:7] == ["0.033333", "4"]
    assert len(lines) == 11
    assert lines[7].count("\t") == 54
    assert lines[7].split("\t")[0] == f"{PROFILE.q[0, 0]:.6f}"


@pytest.mark.parametrize("compat", [False, True])
def test_reading_and_writing_is_an_identity(tmp_path: Path, compat: bool) -> None:
    """B8.2: the thesis's reader moves the motion to the origin; here that is kept and added back."""
    write_profile(tmp_path / "a.txt", PROFILE)
    profile = read_profile(tmp_path / "a.txt", thesis_compat=compat)
    assert profile.q[0, :3] == approx(np.zeros(3) if compat else PROFILE.q[0, :3])
    write_profile(tmp_path / "b.txt", profile)
    assert (tmp_path / "b.txt").read_bytes() == (tmp_path / "a.txt").read_bytes()


def test_splines_reach_their_end() -> None:
    """B8.3, and its last sample at the end time."""
    splines = [lambda t, k=k: k + t for k in range(55)]
    profile = profile_from_splines(splines, 2.0, 5, unit=0.01)
    assert profile.seconds == 0.5
    assert profile.q[-1, :6] == approx(np.array([0.03, 0.04, -0.02, -6.0, -7.0, 5.0]))
    assert profile.q[-1, 6:] == approx(np.arange(6, 55) + 2.0)
    assert profile_from_splines(splines, 2.0, 5, thesis_compat=True).q[-1, 10] == approx(10 + 1.6)
    with pytest.raises(ShapeError, match="splines: expected 55 of them, found 54"):
        profile_from_splines(splines[:-1], 2.0, 5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.replace("0.033333", "-1"),
            "line 6: expected the time between frames, a positive number, found '-1'",
        ),
        (lambda t: t.replace("\n4\n", "\n5\n"), "line 7: expected the number of frames that follow, found 5 for 4"),
        (lambda t: t.rstrip() + "\t1.0\n", "line 11: expected 55 numbers, found 56"),
        (lambda t: t.rsplit("\t", 1)[0] + "\tnan\n", "line 11: expected finite numbers, found 'nan'"),
        (lambda t: "", "line 1: expected the time between frames"),
    ],
)
def test_bad_profiles_are_refused_with_the_line(tmp_path: Path, change, message: str) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    write_profile(tmp_path / "a.txt", PROFILE)
    (tmp_path / "a.txt").write_text(change((tmp_path / "a.txt").read_text()))
    with pytest.raises(CaptureError, match=message):
        read_profile(tmp_path / "a.txt")
