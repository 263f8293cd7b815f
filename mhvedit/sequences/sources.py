"""Where frames come from: a folder of numbered files or one .npz; frame numbers are known before meshes are read."""

import os
import re
import threading
import zipfile
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError, counted
from mhvedit.files import ONE_HEADER, UNREADABLE, found_instead, load_npz
from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.contents import Contents, Stamp, hash_of_bytes, stamp_of
from mhvedit.sequences.formats import PARSERS, parse_mesh
from mhvedit.sequences.raw import RawMesh, checked_mesh


class FrameSource(Protocol):
    """A capture on disk; can be pickled, so that other processes can read from it."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Frame numbers, ascending."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of each frame, or those that hold all, the one that was opened first."""

    @property
    def per_frame(self) -> bool:
        """Whether each frame has a file of its own."""

    @property
    def fps(self) -> float | None:
        """Frames a second, where the capture itself says so."""

    def opened(self, number: int) -> tuple[str, Any]:
        """What identifies the content of a frame, and what `parsed` needs to go on."""

    def parsed(self, number: int, opened: Any) -> RawMesh:  # noqa: ANN401 - each source passes its own thing to itself
        """The mesh of a frame."""


class FolderSource:
    """A folder of numbered mesh files; a file that has not changed since is not hashed again."""

    fps, per_frame = None, True

    def __init__(self, folder: Path, known: Contents | None = None) -> None:
        """Look through a folder; `known`: hashes that are remembered, for others to share."""
        self._by_number = numbered_files(folder)
        self._known = Contents(None) if known is None else known
        self.numbers = tuple(self._by_number)
        self.files = tuple(self._by_number.values())

    def opened(self, number: int) -> tuple[str, tuple[str, bytes | None]]:
        """A hash of the file's content and format; and the hash, with the content if it was read for that."""
        hashed = self._hashed(number)
        return f"{self._by_number[number].suffix.lower()}:{hashed[0]}", hashed

    def parsed(self, number: int, opened: tuple[str, bytes | None]) -> RawMesh:
        """The mesh of one file."""
        identity, data = opened
        file = self._by_number[number]
        if data is None:
            data = self._read(number)
            if hash_of_bytes(data) != identity:
                raise CaptureError(file, "a file that stays as it is while it is read", "a change")
        return parse_mesh(data, file)

    def _hashed(self, number: int) -> tuple[str, bytes | None]:
        file = self._by_number[number]
        try:
            return self._known.hash_of(file)
        except OSError as error:
            raise CaptureError(file, "a file that can be read", str(error.strerror)) from error

    def _read(self, number: int) -> bytes:
        file = self._by_number[number]
        try:
            return file.read_bytes()
        except OSError as error:
            raise CaptureError(file, "a file that can be read", str(error.strerror)) from error


def numbered_files(folder: Path) -> dict[int, Path]:
    """Mesh files by frame number, which is the last run of digits in the name; all other files are left alone.

    Raises:
        CaptureError: no such folder, no numbered mesh in it, two formats, or one number twice.
    """
    found: dict[int, Path] = {}
    try:
        with os.scandir(folder) as entries:
            inside = sorted(entries, key=lambda entry: entry.name)
    except OSError as error:
        raise CaptureError(folder, "a folder that can be read", str(error.strerror)) from error
    first: Path | None = None
    for entry in inside:
        file = Path(entry.path)
        suffix, digits = file.suffix.lower(), re.findall(r"\d+", file.stem)
        if not digits or entry.name.startswith(".") or suffix not in PARSERS or entry.is_dir():
            continue
        number, first = int(digits[-1]), first or file
        if suffix != first.suffix.lower():
            raise CaptureError(folder, "meshes of one format", f"{first.name} and {file.name}")
        if number in found:
            raise CaptureError(folder, "each frame number once", f"{found[number].name} and {file.name}")
        found[number] = file
    if not found:
        raise CaptureError(folder, "numbered files like body_0001 ending in " + " ".join(PARSERS), _instead(inside))
    return dict(sorted(found.items()))


def _instead(inside: list[os.DirEntry[str]]) -> str:
    """What there is in a folder without numbered meshes, and whether they are in a folder of it."""
    folders = [entry for entry in inside if entry.is_dir()]
    others = [entry for entry in inside if not entry.is_dir()]
    kinds = (("folder", folders), ("other file", others))
    said = " and ".join(f"{counted(len(all_), noun)} ({all_[0].name} ...)" for noun, all_ in kinds if all_)
    below = next((entry.name for entry in folders if _has_meshes(Path(entry.path))), None)
    return (said or "an empty folder") + ("" if below is None else f"; it is a level too high: {below} has such files")


def _has_meshes(folder: Path) -> bool:
    try:
        return any(re.search(r"\d", file.stem) and file.suffix.lower() in PARSERS for file in folder.iterdir())
    except OSError:
        return False


class NpzSource:
    """One .npz, described in `docs/scene-file.md`; its arrays are read when the first frame is asked for, and kept."""

    per_frame = False

    def __init__(self, path: Path, known: Contents | None = None) -> None:
        """Look at what the file holds; `known`: hashes that are remembered."""
        self._path, self._lock, self._arrays = path, threading.Lock(), dict[str, NDArray[Any]]()
        self._held = HeldOpen(path, (path,), known)
        small, shapes = _npz_overview(path)
        self._rows = {"vertices": _offsets(small["vertex_counts"]), "faces": _offsets(small["face_counts"])}
        _check_npz(path, small, shapes)
        self._names = shapes.keys() | small.keys() & {"scale", "origin"}
        numbers = small.get("frame_numbers", np.arange(len(small["vertex_counts"]))).astype(np.int64)
        self._place = {int(numbers[i]): int(i) for i in np.argsort(numbers, kind="stable")}
        self.numbers, self.files = tuple(self._place), (path,)
        self.fps = float(small["fps"].reshape(-1)[0]) if "fps" in small else None

    def __reduce__(self) -> tuple[type["NpzSource"], tuple[Path, Contents]]:
        """Another process opens the file for itself."""
        return NpzSource, (self._path, self._held.known)

    def opened(self, number: int) -> tuple[str, None]:
        """What the file holds, and the frame."""
        return f"{self._held.identity()}:{number}", None

    def parsed(self, number: int, opened: None) -> RawMesh:
        """One frame; integers become metres by scale and origin."""
        i, arrays = self._place[number], self._all()
        where = f"{self._path}: frame {number}"
        v, f = (slice(*self._rows[name][i : i + 2]) for name in ("vertices", "faces"))
        vertices = arrays["vertices"][v]
        if "scale" in arrays:
            vertices = vertices.astype(np.float64) * arrays["scale"].reshape(-1) + arrays["origin"]
        labels = arrays["labels"][v] if "labels" in arrays else None
        return checked_mesh(where, vertices, arrays["faces"][f], labels)

    def _all(self) -> dict[str, NDArray[Any]]:
        """The arrays, read once."""
        with self._lock:
            if not self._arrays:
                try:
                    self._arrays = load_npz(self._path, *self._names)
                except UNREADABLE as error:
                    raise CaptureError(self._path, "a readable .npz", found_instead(error)) from error
            return self._arrays


def _npz_overview(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, tuple[int, ...]]]:
    """The small arrays, and shape and type of the large ones from their headers."""
    small, shapes = dict[str, NDArray[Any]](), dict[str, tuple[int, ...]]()
    try:
        with (
            ONE_HEADER,
            path.open("rb") as data,
            np.load(data, allow_pickle=False) as stored,
            zipfile.ZipFile(path) as container,
        ):
            missing = {"vertices", "faces", "vertex_counts", "face_counts"} - set(stored.files)
            if missing:
                held = ", ".join(sorted(stored.files)) or "nothing"
                raise CaptureError(path, f"an array called {min(missing)}", held)
            for name in stored.files:
                if name in ("vertices", "faces", "labels"):
                    with container.open(f"{name}.npy") as member:
                        shapes[name], kind = _array_header(member)
                        small[f"type of {name}"] = np.zeros(0, kind)
                elif name in ("vertex_counts", "face_counts", "frame_numbers", "fps", "scale", "origin"):
                    small[name] = stored[name]
    except UNREADABLE as error:
        if isinstance(error, CaptureError):
            raise
        raise CaptureError(path, "a readable .npz", found_instead(error)) from error
    return small, shapes


def _array_header(member: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:  # noqa: ANN401 - any open binary file
    """Shape and type from the start of a .npy file."""
    version = np.lib.format.read_magic(member)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(member)
    return tuple(shape), kind


def _check_npz(path: Path, small: dict[str, NDArray[Any]], shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuse arrays that do not fit together.

    Raises:
        CaptureError: naming the array, what was expected and what is there.
    """
    n = len(np.atleast_1d(small["vertex_counts"]))
    rows = {"vertices": int(small["vertex_counts"].sum()), "faces": int(small["face_counts"].sum())}
    wanted = {name: (rows[name], 3) for name in rows} | {"labels": (rows["vertices"],)}
    kinds = {name: small[f"type of {name}"].dtype for name in shapes}
    checks: list[tuple[str, bool, object]] = [
        (f"{name} of shape {wanted[name]}", shapes[name] == wanted[name], shapes[name]) for name in shapes
    ]
    for name in ("vertex_counts", "face_counts", "frame_numbers"):
        if name in small:
            a = small[name]
            checks.append((f"{n} integers in {name}", a.shape == (n,) and a.dtype.kind in "iu", f"{a.dtype} {a.shape}"))
    checks += [
        ("at least one frame", n > 0, "none"),
        ("numbers in vertices", kinds["vertices"].kind in "iuf", kinds["vertices"]),
        ("integers in faces", kinds["faces"].kind in "iu", kinds["faces"]),
        ("scale and origin, as vertices are integers", kinds["vertices"].kind == "f" or "scale" in small, "no scale"),
    ]
    if "scale" in small:
        origin = small.get("origin", np.zeros(0))
        checks.append(("one scale", small["scale"].size == 1, small["scale"].shape))
        checks.append(("an origin of 3 numbers", origin.shape == (3,), origin.shape))
    if "fps" in small:
        fps = small["fps"]
        checks.append(("one positive fps", fps.size == 1 and bool((fps > 0).all()), fps))
    for expected, good, found in checks:
        if not good:
            raise CaptureError(path, expected, str(found))
    _check_numbers(path, small)


def _check_numbers(path: Path, small: dict[str, NDArray[Any]]) -> None:
    """Refuse negative counts and frame numbers that come twice."""
    if (small["vertex_counts"] < 0).any() or (small["face_counts"] < 0).any():
        raise CaptureError(path, "counts of 0 or more", "a negative one")
    if "frame_numbers" in small:
        values, times = np.unique(small["frame_numbers"], return_counts=True)
        if (times > 1).any():
            raise CaptureError(path, "each frame number once", f"{values[times > 1][0]} twice")


def _offsets(counts: NDArray[Any]) -> IntArray:
    """Where each frame starts, and where the last ends."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


class HeldOpen:
    """The files of a capture that stays open: what is read of them is kept as theirs, so they must stay the same."""

    def __init__(self, path: Path, files: tuple[Path, ...], known: Contents | None) -> None:
        """Note how the files stand.

        Args:
            path: of the capture, to be told.
            files: that it is read from.
            known: hashes that are remembered.

        Raises:
            CaptureError: one of the files cannot be looked at.
        """
        self.known = Contents(None) if known is None else known
        self._path, self._files, self._lock = path, files, threading.Lock()
        self._stamps, self._identity = self._looked_at(), ""

    def identity(self) -> str:
        """What the files hold, as a hash.

        Raises:
            CaptureError: they hold something else by now, or are gone.
        """
        stamps = self._looked_at()
        with self._lock:
            if not self._identity or stamps != self._stamps:
                held = self.known.of(self._files)
                if stamps != self._stamps and held != self._identity:
                    expected = "a file that stays as it is while it is open (open it again)"
                    raise CaptureError(self._path, expected, "a change")
                self._stamps, self._identity = stamps, held
            return self._identity

    def _looked_at(self) -> list[Stamp]:
        try:
            return [stamp_of(file) for file in self._files]
        except OSError as error:
            raise CaptureError(error.filename or self._path, "a file that can be read", str(error.strerror)) from error
