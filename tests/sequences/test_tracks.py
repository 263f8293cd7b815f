from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError
from mhvedit.sequences.axes import METRES, UP_AXES
from mhvedit.sequences.meshes import JointTracks
from mhvedit.sequences.tracks import read_tracks, write_tracks

HEADER = "frame,joint,x,y,z\n"


def csv(tmp_path: Path, text: str) -> Path:
    (tmp_path / "t.csv").write_text(text)
    return tmp_path / "t.csv"


def test_frames_joints_and_what_is_missing(tmp_path: Path) -> None:
    tracks = read_tracks(csv(tmp_path, HEADER + "7,hand,1,2,3\n\n3,hand,4,5,6\n3,head, 0 ,0,1e-1\n"))
    assert tracks.numbers.tolist() == [3, 7] and tracks.joints == ("hand", "head")
    assert tracks.positions[0].tolist() == [[4, 5, 6], [0, 0, 0.1]]
    assert tracks.positions[1, 0].tolist() == [1, 2, 3] and np.isnan(tracks.positions[1, 1]).all()


def test_units_and_up_axis(tmp_path: Path) -> None:
    tracks = read_tracks(csv(tmp_path, HEADER + "0,a,100,200,300\n"), units="cm", up="y")
    assert tracks.positions[0, 0].tolist() == [1, -3, 2]


def test_other_columns_orders_and_a_byte_order_mark(tmp_path: Path) -> None:
    tracks = read_tracks(csv(tmp_path, "\ufeffz,note,joint,frame,x,y\n3,hi,hand,5,1,2\n"))
    assert tracks.numbers.tolist() == [5] and tracks.positions[0, 0].tolist() == [1, 2, 3]


@pytest.mark.parametrize("up", UP_AXES)
@pytest.mark.parametrize("units", METRES)
def test_round_trip(tmp_path: Path, units: str, up: str) -> None:
    positions = np.random.default_rng(3).normal(size=(4, 2, 3))
    positions[2, 1] = np.nan
    tracks = JointTracks(np.array([0, 1, 5, 6]), ("a, b", 'left "hand"'), positions)
    write_tracks(tracks, tmp_path / "t.csv", units=units, up=up)
    again = read_tracks(tmp_path / "t.csv", units=units, up=up)
    assert again.joints == tracks.joints and again.numbers.tolist() == tracks.numbers.tolist()
    np.testing.assert_allclose(again.positions, positions, rtol=1e-15 if units != "m" else 0)
    assert [f.name for f in tmp_path.iterdir()] == ["t.csv"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "t.csv: line 1: expected the header frame,joint,x,y,z, found ''"),
        ("frame,name,x,y,z\n", "t.csv: line 1: expected the header frame,joint,x,y,z, found 'frame,name,x,y,z'"),
        (HEADER, "t.csv: expected at least one row, found none"),
        (
            HEADER + "0,a,1,2,3\n1,a,1,2\n",
            "t.csv: line 3: expected a frame number, a joint and three numbers, found '1,a,1,2'",
        ),
        (HEADER + "0.5,a,1,2,3\n", "t.csv: line 2: expected a frame number"),
        (HEADER + f"0,a,1,2,3\n{10**20},a,1,2,3\n", "t.csv: line 3: expected a frame number"),
        (HEADER + "0,a,1,two,3\n", "t.csv: line 2: expected a frame number"),
        (HEADER + "0,a,1,nan,3\n", "t.csv: line 2: expected a joint with a finite position, found '0,a,1,nan,3'"),
        (HEADER + "0,,1,2,3\n", "t.csv: line 2: expected a joint with a finite position"),
        (
            HEADER + "0,a,1,2,3\n0,a,1,2,3\n",
            "t.csv: line 3: expected each joint once a frame, found a again in frame 0",
        ),
        (
            HEADER + "7,a,1,2,3\n\n7,b,1,2,3\n07, a,1,2,3\n8,a,1,2\n",
            "t.csv: line 5: expected each joint once a frame, found a again in frame 7",
        ),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        read_tracks(csv(tmp_path, text))


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"gone.csv: expected a readable CSV file, found No such file or directory"):
        read_tracks(tmp_path / "gone.csv")
