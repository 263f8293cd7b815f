import multiprocessing
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.errors import CaptureError, MissingFrame
from mhvedit.sequences import read
from mhvedit.sequences.areas import place_of
from mhvedit.sequences.formats import PARSERS
from mhvedit.sequences.read import open_capture

BALL = trimesh.creation.icosphere(subdivisions=1)


def written(folder: Path, suffix: str = ".obj", numbers: tuple[int, ...] = (0, 1, 4)) -> Path:
    folder.mkdir()
    for number in numbers:
        BALL.copy().apply_translation((0, 0, number)).export(folder / f"body_{number:04}{suffix}")
    return folder


def test_gaps_stay_gaps(tmp_path: Path) -> None:
    capture = open_capture(written(tmp_path / "a"), name="anna", fps=30)
    assert (capture.name, capture.numbers, capture.fps) == ("anna", (0, 1, 4), 30.0)
    assert [f.name for f in capture.files] == ["body_0000.obj", "body_0001.obj", "body_0004.obj"]
    assert capture.mesh(4).vertices[:, 2].mean() == pytest.approx(4)
    with pytest.raises(MissingFrame, match=r"anna: expected frame 2, found 0 to 4 \(3 frames\)"):
        capture.mesh(2)


def test_units_and_up_axis(tmp_path: Path) -> None:
    folder = written(tmp_path / "a")
    plain = open_capture(folder, name="a").mesh(1).vertices
    turned = open_capture(folder, name="a", units="mm", up="y").mesh(1).vertices
    assert (turned == np.stack([plain[:, 0], -plain[:, 2], plain[:, 1]], 1) * 0.001).all()


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_with_and_without_cache_to_the_last_bit(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = written(tmp_path / "a", suffix)
    plain = open_capture(folder, name="a", units="cm", up="y").mesh(1)
    first = open_capture(folder, name="a", units="cm", up="y", cache=tmp_path / "cache").mesh(1)
    monkeypatch.setitem(PARSERS, suffix, pytest.fail)
    second = open_capture(folder, name="a", units="cm", up="y", cache=tmp_path / "cache").mesh(1)
    for mesh in (first, second):
        assert mesh.vertices.tobytes() == plain.vertices.tobytes()
        assert mesh.faces.tobytes() == plain.faces.tobytes()
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_cached_copy_serves_other_units(tmp_path: Path) -> None:
    folder = written(tmp_path / "a")
    metres = open_capture(folder, name="a", cache=tmp_path / "cache").mesh(0)
    centimetres = open_capture(folder, name="a", units="cm", cache=tmp_path / "cache").mesh(0)
    assert (centimetres.vertices == metres.vertices * 0.01).all()
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_changed_content_is_read_anew_even_with_old_size_and_time(tmp_path: Path) -> None:
    folder = written(tmp_path / "a")
    file, cache = folder / "body_0000.obj", tmp_path / "cache"
    before, state = open_capture(folder, name="a", cache=cache).mesh(0), file.stat()
    *rest, last = file.read_text().split("\nf ")
    file.write_text("\nf ".join([*rest, " ".join(last.split()[::-1]).ljust(len(last))]))
    assert file.stat().st_size == state.st_size
    os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert (open_capture(folder, name="a", cache=cache).mesh(0).faces != before.faces).any()


def test_changed_version_is_read_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, cache = written(tmp_path / "a"), tmp_path / "cache"
    open_capture(folder, name="a", cache=cache).mesh(0)
    monkeypatch.setattr(read, "VERSION", -1)
    open_capture(folder, name="a", cache=cache).mesh(0)
    assert len(list(cache.iterdir())) == 2


def _bytes_of_all(folder: Path, cache: Path) -> list[bytes]:
    capture = open_capture(folder, name="a", cache=cache)
    return [capture.mesh(number).vertices.tobytes() for number in capture.numbers]


def test_two_processes_at_once(tmp_path: Path) -> None:
    folder, cache = written(tmp_path / "a", numbers=tuple(range(12))), tmp_path / "cache"
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        results = pool.starmap(_bytes_of_all, [(folder, cache)] * 4)
    assert all(result == _bytes_of_all(folder, cache) for result in results)
    assert len(list(cache.iterdir())) == 12


def test_captures_can_be_pickled(tmp_path: Path) -> None:
    capture = open_capture(written(tmp_path / "a"), name="a", units="cm")
    again = pickle.loads(pickle.dumps(capture))
    assert (again.mesh(4).vertices == capture.mesh(4).vertices).all()


def test_npz_capture(tmp_path: Path) -> None:
    v, f = BALL.vertices, BALL.faces
    np.savez(tmp_path / "a.npz", vertices=v, faces=f, fps=24, vertex_counts=[len(v)], face_counts=[len(f)])
    capture = open_capture(tmp_path / "a.npz", name="a", cache=tmp_path / "cache")
    assert capture.fps == 24.0 and open_capture(tmp_path / "a.npz", name="a", fps=30).fps == 30.0
    for _ in range(2):
        assert (capture.mesh(0).vertices == BALL.vertices).all() and (capture.mesh(0).faces == BALL.faces).all()


@pytest.mark.parametrize(
    ("name", "found"),
    [("gone", "nothing"), ("a.txt", "a .txt file"), ("a.obj", "a .obj file"), ("plain", "a nameless file")],
)
def test_what_is_no_capture(tmp_path: Path, name: str, found: str) -> None:
    if name != "gone":
        (tmp_path / name).write_text("x")
    with pytest.raises(
        CaptureError, match=f"expected a folder of numbered meshes, a .npz or a USD file, found {found}$"
    ):
        open_capture(tmp_path / name, name="a")


def test_unknown_units(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="expected units of m, cm, mm and up of x, y, z, found 'inch' and 'z'"):
        open_capture(written(tmp_path / "a"), name="a", units="inch")


def test_where_a_frame_is_comes_from_beside_it(tmp_path: Path) -> None:
    folder, cache = written(tmp_path / "a"), tmp_path / "cache"
    for units, up in (("m", "z"), ("cm", "y")):
        capture = open_capture(folder, name="a", units=units, up=up, cache=cache)
        assert capture.place is not None
        number = capture.numbers[0]
        first = capture.place(number)
        assert first.tobytes() == place_of(capture.mesh(number)).tobytes()
        for file in cache.glob("*.npz"):
            file.unlink()
        assert capture.place(number).tobytes() == first.tobytes() and not list(cache.glob("*.npz"))
    assert open_capture(folder, name="a").place is None
