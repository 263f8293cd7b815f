import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError, MissingLibrary
from mhvedit.export import movie
from mhvedit.export.movie import encoder, frames_shown, write_movie
from mhvedit.export.target import ExportError
from mhvedit.geometry.arrays import ByteArray

SIZE = (64, 48)


def pictures(n: int) -> Iterator[ByteArray]:
    for k in range(n):
        yield np.full((48, 64, 3), k % 256, np.uint8)


@pytest.mark.parametrize(("fps", "wanted"), [(25.0, 24.0), (30.0, 60.0), (30000 / 1001, 30.0), (25.0, 1.0)])
def test_a_movie_of_another_rate_lasts_as_long(fps: float, wanted: float) -> None:
    shown = frames_shown(100, fps, wanted)
    assert len(shown) / wanted == pytest.approx(100 / fps, abs=0.5 / wanted)
    assert shown[0] == 0 and (np.diff(shown) >= 0).all() and shown[-1] <= 99
    for k, frame in enumerate(shown[:-1]):
        assert frame / fps <= k / wanted + 1e-9 < (frame + 1) / fps + 1e-8


def test_the_same_rate_shows_every_frame_once() -> None:
    for fps in (24.0, 25.0, 30000 / 1001, 59.94):
        assert frames_shown(1000, fps, fps) == list(range(1000))


def test_what_goes_wrong_with_a_frame_leaves_nothing(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")

    def damaged() -> Iterator[ByteArray]:
        yield from pictures(2)
        raise CaptureError("a_0002.obj", "a mesh", "none")

    (tmp_path / "m.mp4").write_text("an earlier one")
    with pytest.raises(CaptureError):
        write_movie(damaged(), tmp_path / "m.mp4", size=SIZE, fps=25.0)
    assert (tmp_path / "m.mp4").read_text() == "an earlier one" and len(list(tmp_path.iterdir())) == 1


def test_an_encoder_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.setattr(movie, "ENCODING", ("-c:v", "libx264", "-crf", "never"))
    with pytest.raises(ExportError, match=r"m.mp4: expected a movie from ffmpeg, found .*never"):
        write_movie(pictures(400), tmp_path / "m.mp4", size=SIZE, fps=25.0)
    assert list(tmp_path.iterdir()) == []


def test_without_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingLibrary, match=r"pip install 'mhvedit\[video\]'"):
        encoder()
