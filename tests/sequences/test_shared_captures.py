"""The real captures: read as the judge reads them, and said to be what they are."""

from pathlib import Path

import DracoPy
import numpy as np
import pytest

from mhvedit.sequences.axes import from_metres_z_up
from mhvedit.sequences.guess import guess_units, guess_up
from mhvedit.sequences.inspect import capture_warnings, inspect_capture
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="no shared data here")

CAPTURES = ("basketball_player", "dancer", "mitch", "thomas")
TAKES = [
    f"{scene}/{who}" for scene in ("box_follow", "crawl_out", "greeting", "pushup_grab", "salsa_open") for who in "ab"
]


@pytest.mark.parametrize("name", CAPTURES)
def test_real_captures(name: str) -> None:
    s = inspect_capture(DATA / "captures" / name, fps=30, units="m", up="z")
    assert s.numbers == tuple(range(10)) and len(s.frames) == 10 and s.connectivity_changes
    assert capture_warnings(s) == ()
    assert 1.7 < s.height < 1.9 and (s.likely_units, s.likely_up) == ("m", "z")
    edges = [frame.open_edges for frame in s.frames]
    assert all(65 <= n <= 86 for n in edges) if name in ("dancer", "basketball_player") else not any(edges)


@pytest.mark.parametrize("take", TAKES)
def test_takes(take: str) -> None:
    path = DATA / "scenes" / take
    capture = open_capture(path, name=take, fps=25)
    number = capture.numbers[len(capture.numbers) // 2]
    mesh = capture.mesh(number)
    judged = DracoPy.decode(capture.files[capture.numbers.index(number)].read_bytes())
    assert (mesh.vertices == judged.points).all() and (mesh.faces == judged.faces).all()
    assert capture_warnings(inspect_capture(path, fps=25, units="m", up="z", most=8)) == ()
    tracks = read_tracks(path.with_suffix(".csv"))
    assert tuple(tracks.numbers) == capture.numbers and np.isfinite(tracks.positions).all()
    hips = tracks.positions[list(tracks.numbers).index(number), tracks.joints.index("Hips")]
    assert (mesh.vertices.min(0) < hips).all() and (hips < mesh.vertices.max(0)).all()


@pytest.mark.parametrize("up", ["x", "y"])
@pytest.mark.parametrize("path", [*(f"captures/{c}" for c in CAPTURES), "scenes/greeting/a", "scenes/salsa_open/b"])
def test_standing_people_saved_with_another_axis_and_in_cm(path: str, up: str) -> None:
    capture = open_capture(DATA / path, name="a")
    saved = [
        from_metres_z_up(capture.mesh(n).vertices, units="cm", up=up)
        for n in capture.numbers[:: len(capture.numbers) // 5]
    ]
    low, high = (np.array([f(points, axis=0) for points in saved]) for f in (np.min, np.max))
    assert guess_units(low, high) == "cm"
    assert guess_up(low / 100, high / 100) == up
