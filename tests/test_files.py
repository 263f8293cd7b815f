"""Files that are there whole or not at all."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy
from numpy.typing import NDArray

from mhvedit.files import ALIGNED, PIECE, Column, load_npz, map_arrays, read_arrays, replacing, write_arrays
from mhvedit.geometry.arrays import FloatArray

KINDS = (np.uint8, np.bool_, np.int32, np.uint64, np.float64)


@pytest.mark.parametrize("dtype", [np.float64, np.uint8])
def test_a_column_is_written_as_if_it_were_an_array(dtype: type, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def fill(first: int, out: FloatArray) -> None:
        out[:] = numbers[first : first + len(out)]

    for shape in ((0,), (1,), (PIECE,), (PIECE + 3,), (3, PIECE // 2, 2), (7, 5), (0, 4)):
        numbers: NDArray[Any] = rng.normal(size=shape).astype(dtype)
        write_arrays(tmp_path / "a.npz", {"n": numbers, "m": np.arange(5)})
        write_arrays(tmp_path / "b.npz", {"n": Column(shape, fill, dtype), "m": np.arange(5)})
        assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_arrays_are_written_however_they_lie_in_memory(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    for kind, shape in ((np.uint8, (70, 50, 40)), (np.float64, (300, 500)), (np.float64, (40, 3))):
        straight: NDArray[Any] = rng.integers(0, 5, shape).astype(kind)
        turned = np.asfortranarray(straight)
        write_arrays(tmp_path / "a.npz", {"n": straight, "zeros": np.zeros(PIECE * 2)})
        write_arrays(tmp_path / "b.npz", {"n": turned, "zeros": np.broadcast_to(np.zeros(1), PIECE * 2)})
        assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_file_takes_the_place_of_another(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with replacing(tmp_path / "a") as beside:
        beside.write_text("new")
        assert (tmp_path / "a").read_text() == "old"
    assert (tmp_path / "a").read_text() == "new" and len(list(tmp_path.iterdir())) == 1


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "a") as beside:
        beside.write_text("half")
        raise KeyboardInterrupt
    assert (tmp_path / "a").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


@given(
    arrays=st.dictionaries(
        st.sampled_from(["x", "räume", "reason", "a_b"]),
        st.sampled_from(KINDS).flatmap(
            lambda kind: st_numpy.arrays(kind, st_numpy.array_shapes(min_dims=0, max_dims=3, min_side=0))
        ),
        min_size=1,
    )
)
def test_arrays_come_back(arrays: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("arrays") / "a.npz"
    write_arrays(path, arrays)
    with np.load(path) as read:
        assert set(read.files) == set(arrays)
        for name, array in arrays.items():
            np.testing.assert_array_equal(read[name], array)
    for name, array in map_arrays(path, list(arrays)).items():
        np.testing.assert_array_equal(array, arrays[name])
    whole = read_arrays(path)
    assert set(whole) == set(arrays)
    for name, array in whole.items():
        assert array.dtype == arrays[name].dtype
        np.testing.assert_array_equal(array, arrays[name])


def test_large_arrays_are_mapped_where_numbers_lie_aligned(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    arrays = {"flags": rng.random(9000) < 0.01, "odd": np.arange(3), "x": rng.random(5000), "y": rng.random((700, 3)).T}
    write_arrays(tmp_path / "a.npz", arrays)
    mapped = map_arrays(tmp_path / "a.npz", ["y", "x", "flags"])
    for name, array in mapped.items():
        np.testing.assert_array_equal(array, arrays[name])
    for name in ("x", "y"):
        assert not mapped[name].flags.owndata and mapped[name].flags.aligned
        assert mapped[name].ctypes.data % ALIGNED == 0
    with zipfile.ZipFile(tmp_path / "a.npz") as container:
        assert container.testzip() is None
        assert container.getinfo("flags.npy").compress_size < 2000


def test_the_same_arrays_make_the_same_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_arrays(tmp_path / name, {"x": np.arange(10.0), "reason": np.zeros(9999, np.uint8)})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_file_that_was_cut_off(tmp_path: Path, share: float) -> None:
    path = tmp_path / "a.npz"
    write_arrays(path, {"x": np.arange(9999.0)})
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises((ValueError, zipfile.BadZipFile, EOFError)):
        map_arrays(path, ["x"])


def test_an_array_that_is_not_there(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a.npz", {"x": np.arange(3)})
    with pytest.raises(KeyError):
        map_arrays(tmp_path / "a.npz", ["y"])


def test_what_is_read_as_a_whole_is_aligned_its_own_and_checked(tmp_path: Path) -> None:
    arrays: dict[str, Any] = {
        "x": np.random.default_rng(0).random((900, 3)),
        "n": np.arange(4000, dtype=np.int32).reshape(50, 80).T,
    }
    write_arrays(tmp_path / "a.npz", arrays)
    np.savez(tmp_path / "b.npz", **arrays)
    for name in ("a.npz", "b.npz"):
        for key, array in read_arrays(tmp_path / name).items():
            np.testing.assert_array_equal(array, arrays[key])
            assert array.flags.aligned and array.flags.writeable
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(zipfile.BadZipFile):
        read_arrays(tmp_path / "a.npz")


@pytest.mark.parametrize("read", [read_arrays, lambda path: map_arrays(path, ["x"])])
def test_a_file_whose_list_of_members_is_damaged_is_a_damaged_file(
    read: Callable[[Path], object], tmp_path: Path
) -> None:
    write_arrays(tmp_path / "a.npz", {"x": np.arange(1000.0)})
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[data.rindex(b"PK\x01\x02") + 44] ^= 0x10  # where the member begins
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(zipfile.BadZipFile):
        read(tmp_path / "a.npz")


def test_an_npz_of_anybody_is_read_by_names_or_by_how_they_start(tmp_path: Path) -> None:
    path = tmp_path / "other.npz"
    arrays: dict[str, Any] = {"a": np.arange(3), "thing x": np.eye(2), "thing y": np.zeros(1)}
    np.savez_compressed(path, **arrays)
    assert list(load_npz(path)) == ["a", "thing x", "thing y"]
    assert list(load_npz(path, "thing y", "a")) == ["thing y", "a"]
    assert load_npz(path, starting="thing ")["thing x"].tolist() == [[1, 0], [0, 1]]
    with pytest.raises(KeyError):
        load_npz(path, "b")


def one_array() -> bytes:
    with io.BytesIO() as file:
        np.save(file, np.arange(3))
        return file.getvalue()


@pytest.mark.parametrize("content", [b"", b"PK\3\4", b"words", one_array()])
def test_what_is_no_npz(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "file.npz"
    path.write_bytes(content)
    with pytest.raises((ValueError, EOFError, zipfile.BadZipFile)):
        load_npz(path)
