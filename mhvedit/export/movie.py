"""Encodes pictures as H.264 in an .mp4; frames go to the encoder one by one."""

import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import MissingLibrary
from mhvedit.export.content import Exported
from mhvedit.export.target import ExportError, put_file, staged
from mhvedit.geometry.arrays import ByteArray

ENCODING: Final = (
    "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-preset", "medium",
    "-threads", "2",  # fixed, as it changes what x264 makes of the frames
    "-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1", "-movflags", "+faststart",
)  # fmt: skip


def even_size(width: int, height: int) -> tuple[int, int]:
    """The next size that H.264 with 4:2:0 colours can hold: both sides even.

    >>> even_size(1281, 720)
    (1282, 720)
    """
    return width + width % 2, height + height % 2


def frames_shown(n_frames: int, fps: float, movie_fps: float) -> list[int]:
    """Frame of the scene in each frame of a movie of another rate: as long, nothing in between is made.

    >>> frames_shown(4, 25.0, 50.0), frames_shown(4, 30.0, 15.0)
    ([0, 0, 1, 1, 2, 2, 3, 3], [0, 2])
    """
    count = max(1, round(n_frames * movie_fps / fps))
    return [min(n_frames - 1, int(k * fps / movie_fps + 1e-9)) for k in range(count)]


def encoder() -> str:
    """The ffmpeg that comes with imageio-ffmpeg.

    Raises:
        MissingLibrary: it is not installed.
    """
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise MissingLibrary("writing a movie", "pip install 'mhvedit[video]'") from error


def write_movie(pictures: Iterable[ByteArray], path: Path, *, size: tuple[int, int], fps: float) -> Exported:
    """Write an .mp4.

    Args:
        pictures: (H, W, 3) of each frame; made while it is being written.
        path: .mp4.
        size: width and height in pixels, both even.
        fps: frames a second.

    Raises:
        MissingLibrary: imageio-ffmpeg is not installed.
        ExportError: the encoder failed.
    """
    source = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", repr(fps), "-i", "-")
    with staged(path) as beside, tempfile.TemporaryFile() as said:
        words = [encoder(), "-y", "-loglevel", "error", *source, *ENCODING, str(beside / path.name)]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said) as process:
            try:
                _send(process, pictures)
            except BaseException:
                process.kill()
                raise
        if process.returncode:
            said.seek(0)
            found = " ".join(said.read().decode("utf-8", "replace").split())[:200]
            raise ExportError(path, "a movie from ffmpeg", found or f"its exit code {process.returncode}")
        put_file(beside / path.name, path)
    return Exported(path)


def _send(process: "subprocess.Popen[bytes]", pictures: Iterable[ByteArray]) -> None:
    """All pictures, or as many as the encoder takes before it gives up, which its exit code tells."""
    assert process.stdin is not None
    try:
        for picture in pictures:
            try:
                process.stdin.write(np.ascontiguousarray(picture).tobytes())
            except BrokenPipeError:
                break
    finally:
        with suppress(BrokenPipeError):
            process.stdin.close()
