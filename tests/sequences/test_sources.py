import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mhvedit.errors import CaptureError
from mhvedit.sequences.contents import contents
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.sources import FolderSource, FrameSource, NpzSource

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n"


def raw(source: FrameSource, number: int) -> RawMesh:
    return source.parsed(number, source.opened(number)[1])


def folder(tmp_path: Path, *names: str) -> Path:
    for name in names:
        (tmp_path / name).write_text(TRIANGLE)
    return tmp_path


def test_the_last_digits_are_the_frame_number(tmp_path: Path) -> None:
    source = FolderSource(folder(tmp_path, "take2_0010.obj", "take2_0009.OBJ", "v1_take_3_final.obj", "take2_100x.obj"))
    assert source.numbers == (3, 9, 10, 100)
    assert [f.name for f in source.files] == [
        "v1_take_3_final.obj",
        "take2_0009.OBJ",
        "take2_0010.obj",
        "take2_100x.obj",
    ]
    assert len(raw(source, 9).faces) == 1


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a_0007.obj").mkdir()
    names = ("a_1.obj", "a.mtl", "a_1.png", "floor.ply", "._a_2.obj", ".a_3.ply", "notes_2024.txt", "track.csv")
    assert FolderSource(folder(tmp_path, *names)).numbers == (1,)


def test_nothing_is_read_before_a_frame_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "a_1.obj").write_bytes(b"never a mesh")
    source = FolderSource(tmp_path)
    with pytest.raises(CaptureError, match=r"a_1.obj: expected at least one face"):
        raw(source, 1)


def test_a_file_is_hashed_again_only_if_it_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = FolderSource(folder(tmp_path, "a_1.obj"))
    monkeypatch.setattr("mhvedit.sequences.contents.SETTLED", -1)
    first, read = source.opened(1)
    again, kept = source.opened(1)
    assert (first, read[1], kept[1]) == (again, TRIANGLE.encode(), None)
    assert len(source.parsed(1, kept).faces) == 1
    file, moved = tmp_path / "a_1.obj", TRIANGLE.replace("1 0 0", "2 0 0")
    stat = file.stat()
    file.write_text(moved)  # the same size, and below the same time of change
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    changed, read = source.opened(1)
    assert changed != first and read[1] == moved.encode()


def test_a_file_that_another_run_has_hashed_is_not_hashed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mhvedit.sequences.contents.SETTLED", -1)
    known = contents(tmp_path / "memory.json")
    (tmp_path / "c").mkdir()
    first, (_, read) = FolderSource(folder(tmp_path / "c", "a_1.obj"), known).opened(1)
    known.save()
    source = FolderSource(tmp_path / "c", contents(tmp_path / "memory.json"))
    again, (_, unread) = source.opened(1)
    assert read is not None and unread is None and again == first
    assert len(source.parsed(1, source.opened(1)[1]).faces) == 1


def test_a_file_of_just_now_is_hashed_every_time(tmp_path: Path) -> None:
    """It may change again without another time of change."""
    source = FolderSource(folder(tmp_path, "a_1.obj"))
    assert [source.opened(1)[1][1] for _ in range(2)] == [TRIANGLE.encode()] * 2


def test_a_large_file_has_the_same_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = FolderSource(folder(tmp_path, "a_1.obj"))
    small, _ = source.opened(1)
    monkeypatch.setattr("mhvedit.sequences.contents.LARGE", 4)
    large, opened = source.opened(1)
    assert large == small and opened[1] is None
    assert len(source.parsed(1, opened).faces) == 1


def test_a_change_between_looking_and_reading_is_not_taken_for_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = FolderSource(folder(tmp_path, "a_1.obj"))
    monkeypatch.setattr("mhvedit.sequences.contents.SETTLED", -1)
    source.opened(1)
    _, kept = source.opened(1)
    (tmp_path / "a_1.obj").write_text(TRIANGLE + "# more\n")
    with pytest.raises(CaptureError, match=r"a_1.obj: expected a file that stays as it is while it is read"):
        source.parsed(1, kept)


def test_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(
        CaptureError, match=r"expected numbered files like body_0001 ending in .obj .*, found an empty folder"
    ):
        FolderSource(tmp_path)
    with pytest.raises(CaptureError, match=r"found 2 other files \(a.mtl ...\)"):
        FolderSource(folder(tmp_path, "a.mtl", "body.obj"))


def test_a_folder_of_folders_says_so(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    with pytest.raises(CaptureError, match=r"found 2 folders \(a ...\)$"):
        FolderSource(tmp_path)
    folder(tmp_path / "b", "b_1.obj")
    folder(tmp_path, "track.csv")
    said = r"found 2 folders \(a ...\) and 1 other file \(track.csv ...\); it is a level too high: b has such files$"
    with pytest.raises(CaptureError, match=said):
        FolderSource(tmp_path)


def test_mixed_formats_and_double_numbers_name_both_files(tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    with pytest.raises(CaptureError, match=r"expected meshes of one format, found a_1.obj and a_2.ply"):
        FolderSource(folder(tmp_path / "m", "a_1.obj", "a_2.ply"))
    with pytest.raises(CaptureError, match=r"expected each frame number once, found a_01.obj and a_1.obj"):
        FolderSource(folder(tmp_path, "a_1.obj", "a_01.obj"))


def test_a_file_that_went_away(tmp_path: Path) -> None:
    source = FolderSource(folder(tmp_path, "a_1.obj"))
    (tmp_path / "a_1.obj").unlink()
    with pytest.raises(CaptureError, match=r"a_1.obj: expected a file that can be read, found No such file"):
        raw(source, 1)


def arrays(**changes: Any) -> dict[str, Any]:  # noqa: ANN401
    """Two frames: a triangle and a square."""
    held = {
        "vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float32),
        "faces": np.array([[0, 1, 2], [0, 1, 2], [0, 2, 3]]),
        "vertex_counts": np.array([3, 4]),
        "face_counts": np.array([1, 2]),
        "fps": 25.0,
    } | changes
    return {name: value for name, value in held.items() if value is not None}


def npz(tmp_path: Path, **changes: Any) -> Path:  # noqa: ANN401
    np.savez_compressed(tmp_path / "a.npz", **arrays(**changes))
    return tmp_path / "a.npz"


def test_npz_frames(tmp_path: Path) -> None:
    source = NpzSource(npz(tmp_path))
    assert source.numbers == (0, 1) and source.fps == 25.0
    assert raw(source, 1).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert raw(source, 0).vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
    assert raw(source, 0).vertices.dtype == np.float32


def test_npz_with_numbers_labels_and_integers(tmp_path: Path) -> None:
    path = npz(
        tmp_path,
        frame_numbers=np.array([12, 7]),
        labels=np.arange(7, dtype=np.uint8),
        vertices=np.arange(21, dtype=np.int16).reshape(7, 3),
        scale=0.001,
        origin=np.array([1.0, 2.0, 3.0]),
        fps=None,
    )
    source = NpzSource(path)
    assert source.numbers == (7, 12) and source.fps is None
    mesh = raw(source, 7)
    assert (mesh.vertices == np.arange(9, 21).reshape(4, 3) * 0.001 + [1.0, 2.0, 3.0]).all()
    assert mesh.labels is not None and mesh.labels.tolist() == [3, 4, 5, 6]


def test_an_npz_that_changes_is_not_taken_for_the_one_that_was_opened(tmp_path: Path) -> None:
    source = NpzSource(npz(tmp_path))
    raw(source, 0)
    npz(tmp_path, fps=12.0, vertices=np.zeros((7, 3), np.float32))
    with pytest.raises(CaptureError, match=r"a.npz: expected a file that stays as it is while it is open"):
        raw(source, 1)
    (tmp_path / "a.npz").unlink()
    with pytest.raises(CaptureError, match=r"a.npz: expected a file that can be read, found No such file"):
        raw(source, 1)


def test_an_npz_of_the_same_size_and_time_is_another_if_it_holds_something_else(tmp_path: Path) -> None:
    path, known = tmp_path / "a.npz", contents(tmp_path / "contents.json")
    identities = []
    for scale in (1.0, 2.0, 1.0):
        np.savez(path, **arrays(vertices=arrays()["vertices"] * np.float32(scale)))
        os.utime(path, (1e9, 1e9))
        identities.append((path.stat().st_size, NpzSource(path, known).opened(0)[0]))
    assert len({size for size, _ in identities}) == 1
    assert identities[0] == identities[2] != identities[1]


@pytest.mark.parametrize("seed", range(20))
def test_an_npz_of_which_bytes_are_lost_is_read_or_named(seed: int, tmp_path: Path) -> None:
    path, rng = npz(tmp_path), np.random.default_rng(seed)
    data = np.frombuffer(path.read_bytes(), np.uint8).copy()
    data[rng.integers(0, len(data), 5)] ^= rng.integers(1, 256, 5, np.uint8)
    path.write_bytes(data.tobytes())
    try:
        raw(NpzSource(path), 1)
    except CaptureError as told:
        assert "a.npz" in str(told)


def test_sources_go_to_other_processes(tmp_path: Path) -> None:
    source = pickle.loads(pickle.dumps(NpzSource(npz(tmp_path))))
    assert len(raw(source, 1).faces) == 2
    again = pickle.loads(pickle.dumps(FolderSource(folder(tmp_path, "a_4.obj"))))
    assert len(raw(again, 4).faces) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"faces": None}, "expected an array called faces, found face_counts, fps, vertex_counts, vertices"),
        ({"vertex_counts": np.array([3, 5])}, r"expected vertices of shape \(8, 3\), found \(7, 3\)"),
        ({"face_counts": np.array([1, 1])}, r"expected faces of shape \(2, 3\), found \(3, 3\)"),
        ({"face_counts": np.array([3])}, r"expected 2 integers in face_counts, found int64 \(1,\)"),
        ({"face_counts": np.array([4, -1])}, "expected counts of 0 or more, found a negative one"),
        ({"frame_numbers": np.array([5, 5])}, "expected each frame number once, found 5 twice"),
        ({"frame_numbers": np.array([0.0, 1.0])}, r"expected 2 integers in frame_numbers, found float64 \(2,\)"),
        (
            {"vertices": np.zeros((7, 3), np.int16)},
            "expected scale and origin, as vertices are integers, found no scale",
        ),
        ({"vertices": np.zeros((7, 3), np.int16), "scale": 0.1}, r"expected an origin of 3 numbers, found \(0,\)"),
        ({"faces": np.zeros((3, 3))}, "expected integers in faces, found float64"),
        ({"labels": np.zeros(3, int)}, r"expected labels of shape \(7,\), found \(3,\)"),
        ({"fps": 0.0}, "expected one positive fps, found 0.0"),
    ],
)
def test_npz_that_does_not_fit_together(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(CaptureError, match="a.npz: " + message):
        NpzSource(npz(tmp_path, **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"face_counts": np.array([0, 3])}, "frame 0: expected at least one face"),
        ({"faces": np.full((3, 3), 3)}, "frame 0: expected face indices from 0 to 2"),
        ({"vertices": np.full((7, 3), np.nan)}, "frame 0: expected finite vertices"),
    ],
)
def test_npz_frames_that_cannot_be_used_are_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(CaptureError, match="a.npz: " + message):
        raw(NpzSource(npz(tmp_path, **changes)), 0)


def test_npz_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(b"never an archive")
    with pytest.raises(CaptureError, match=r"a.npz: expected a readable .npz, found "):
        NpzSource(tmp_path / "a.npz")
    for faulty in (b"\x78", b"\xff"):  # bytes of the first array's compressed content: told by zlib alone
        path = npz(tmp_path)
        data = bytearray(path.read_bytes())
        start = data.index(b"faces.npy") + 40
        data[start : start + 20] = faulty * 20
        path.write_bytes(data)
        with pytest.raises(CaptureError, match=r"a.npz: expected a readable .npz, found a file that is damaged"):
            raw(NpzSource(path), 1)
    path = npz(tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CaptureError, match=r"a.npz: expected a readable .npz, found "):
        NpzSource(path)
