import logging
import zipfile
from pathlib import Path

import numpy as np
import pytest

from mhvedit.sequences.cache import cached_mesh, cached_place
from mhvedit.sequences.raw import RawMesh

MESH = RawMesh(np.random.default_rng(1).random((50, 3)), np.arange(48, dtype=np.int32).reshape(-1, 3))
LABELLED = RawMesh(MESH.vertices.astype(np.float32), MESH.faces, np.arange(50, dtype=np.int32))


def never() -> RawMesh:
    raise AssertionError("must not be built again")


def same(a: RawMesh, b: RawMesh) -> bool:
    assert a.vertices.dtype == b.vertices.dtype and a.faces.dtype == b.faces.dtype
    assert (a.labels is None) == (b.labels is None)
    labels = a.labels is None or bool((a.labels == b.labels).all())
    return bool((a.vertices == b.vertices).all() and (a.faces == b.faces).all() and labels)


@pytest.mark.parametrize("mesh", [MESH, LABELLED])
def test_the_second_time_it_is_not_built(tmp_path: Path, mesh: RawMesh) -> None:
    assert same(cached_mesh(tmp_path / "new", "k", lambda: mesh), mesh)
    assert same(cached_mesh(tmp_path / "new", "k", never), mesh)
    assert [f.name for f in (tmp_path / "new").iterdir()] == ["k.npz"]


@pytest.mark.parametrize("where", [0, 40, 200, 700, -30])
@pytest.mark.parametrize("damage", ["cut", "bits", "empty"])
def test_damage_is_rebuilt_and_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, where: int, damage: str
) -> None:
    cached_mesh(tmp_path, "k", lambda: LABELLED)
    file = tmp_path / "k.npz"
    data = bytearray(file.read_bytes())
    if damage == "cut":
        data = data[:where]
    elif damage == "empty":
        data = bytearray()
    else:
        data[where] ^= 0xFF
    file.write_bytes(data)
    with caplog.at_level(logging.WARNING):
        assert same(cached_mesh(tmp_path, "k", lambda: LABELLED), LABELLED)
        assert same(cached_mesh(tmp_path, "k", lambda: LABELLED), LABELLED)
    if damage != "bits":  # a bit that nothing depends on may be anything
        assert len(caplog.records) == 1 and "damaged cache file is rebuilt" in caplog.text


def test_every_bit_of_the_arrays_is_guarded(tmp_path: Path) -> None:
    cached_mesh(tmp_path, "k", lambda: MESH)
    file = tmp_path / "k.npz"
    good = file.read_bytes()
    for at in range(0, len(good), 7):
        data = bytearray(good)
        data[at] ^= 0x10
        file.write_bytes(data)
        assert same(cached_mesh(tmp_path, "k", lambda: MESH), MESH)


def test_a_damaged_array_header_is_rebuilt(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Whole for the zip container, but numpy takes its type for none (a TypeError)."""
    with zipfile.ZipFile(tmp_path / "k.npz", "w") as container:
        header = b"{'descr': 7, 'fortran_order': False, 'shape': (0,), }"
        for name in ("vertices", "faces", "labels"):
            container.writestr(f"{name}.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    assert same(cached_mesh(tmp_path, "k", lambda: MESH), MESH)
    assert "damaged cache file is rebuilt" in caplog.text
    assert same(cached_mesh(tmp_path, "k", never), MESH)


def test_a_folder_that_cannot_be_written(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "blocked").write_text("a file where the folder should be")
    assert same(cached_mesh(tmp_path / "blocked", "k", lambda: MESH), MESH)
    assert "cannot be written" in caplog.text


def test_a_failed_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mhvedit.sequences.cache.write_arrays", full)
    assert same(cached_mesh(tmp_path, "k", lambda: MESH), MESH)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mhvedit.sequences.cache.write_arrays", stopped)
    with pytest.raises(KeyboardInterrupt):
        cached_mesh(tmp_path, "k", lambda: MESH)
    assert not list(tmp_path.iterdir())


def test_errors_of_the_reader_pass_through(tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        cached_mesh(tmp_path, "k", never)


PLACE = np.array([0.1, -0.0, 1e-300, 3.0, -7.5, 2.0, 1 / 3, np.nan])


def test_a_place_is_measured_once(tmp_path: Path) -> None:
    first = cached_place(tmp_path / "new", "k", lambda: PLACE)
    again = cached_place(tmp_path / "new", "k", lambda: np.zeros(8))
    assert first.tobytes() == again.tobytes() == PLACE.tobytes()


@pytest.mark.parametrize("at", [0, 40, 63, 64, 79])
def test_every_bit_of_a_place_is_guarded(tmp_path: Path, at: int) -> None:
    cached_place(tmp_path, "k", lambda: PLACE)
    file = tmp_path / "k.place"
    data = bytearray(file.read_bytes())
    data[at] ^= 4
    for damaged in (data, data[:at]):
        file.write_bytes(damaged)
        assert cached_place(tmp_path, "k", lambda: np.zeros(8)).tolist() == [0.0] * 8
        file.write_bytes(damaged)


def test_a_place_that_cannot_be_kept(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "blocked").write_text("a file where the folder should be")
    assert cached_place(tmp_path / "blocked", "k", lambda: PLACE).tobytes() == PLACE.tobytes()
    assert "cannot be written" in caplog.text
