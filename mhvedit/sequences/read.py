"""The one door through which captures come in, whatever they are stored as."""

import hashlib
from functools import partial
from pathlib import Path
from typing import Final

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.areas import place_of
from mhvedit.sequences.axes import METRES, UP_AXES, to_metres_z_up
from mhvedit.sequences.cache import VERSION, cached_mesh, cached_place
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.sources import FolderSource, FrameSource, NpzSource
from mhvedit.sequences.usd import UsdSource

USD_SUFFIXES: Final = (".usd", ".usda", ".usdc", ".usdz")
PLACES: Final = 1  # of what is kept of a frame's place; raise it when that changes
ASSUMED_FPS: Final = 30.0  # Hz, where neither the caller nor the capture says


def open_capture(
    path: Path | str,
    *,
    name: str,
    fps: float | None = None,
    units: str = "m",
    up: str = "z",
    cache: Path | None = None,
    known: Contents | None = None,
) -> MeshSequence:
    """Open a capture; its meshes are read when they are asked for, one by one.

    A folder of numbered .obj .ply .stl .glb .drc files, one .npz (see `docs/scene-file.md`), or one USD stage with time
    samples. Polygons become fans of triangles; duplicate vertices and faces that name a vertex twice are kept (only
    STL, which has no connectivity, gets corners at the same place joined). `units` and `up` are what counts: what
    a USD stage says about itself, and that glTF is y up by definition, is not applied (`inspect_capture` tells).

    Args:
        path: folder or file.
        name: of the subject.
        fps: Hz; None takes what the capture says (.npz, USD), or else `ASSUMED_FPS`.
        units: m, cm or mm of the vertices on disk.
        up: x, y or z: the axis that points up on disk.
        cache: folder for converted copies, or None for none.
        known: hashes of files that are remembered.

    Raises:
        CaptureError: there is no such capture, or its frames cannot be told apart.
        MissingLibrary: a USD stage, and usd-core is not installed.
    """
    path = Path(path)
    if units not in METRES or up not in UP_AXES:
        expected = f"units of {', '.join(METRES)} and up of {', '.join(UP_AXES)}"
        raise CaptureError(path, expected, f"{units!r} and {up!r}")
    source = open_source(path, known)
    rate = float(fps or source.fps or ASSUMED_FPS)
    load = partial(load_frame, source=source, units=units, up=up, cache=cache)
    place = None if cache is None else partial(load_place, source=source, units=units, up=up, cache=cache)
    return MeshSequence(name, source.numbers, rate, load, source.files, place, per_frame=source.per_frame)


def open_source(path: Path, known: Contents | None = None) -> FrameSource:
    """Find out what a capture is stored as.

    Args:
        path: folder or file.
        known: hashes of files that are remembered.

    Raises:
        CaptureError: nothing there, or nothing that can be a capture.
    """
    if path.is_dir():
        return FolderSource(path, known)
    if not path.exists():
        raise CaptureError(path, "a folder of numbered meshes, a .npz or a USD file", "nothing")
    if path.suffix.lower() == ".npz":
        return NpzSource(path, known)
    if path.suffix.lower() in USD_SUFFIXES:
        return UsdSource(path, known)
    raise CaptureError(path, "a folder of numbered meshes, a .npz or a USD file", f"a {path.suffix or 'nameless'} file")


def load_frame(number: int, *, source: FrameSource, units: str, up: str, cache: Path | None) -> Mesh:
    """Read one frame in metres and z up.

    Raises:
        CaptureError: the frame cannot be read or used.
    """
    raw = load_raw(number, source=source, cache=cache)
    return Mesh(to_metres_z_up(raw.vertices, units=units, up=up), raw.faces, raw.labels)


def load_raw(number: int, *, source: FrameSource, cache: Path | None) -> RawMesh:
    """Read one frame as it is on disk, or its converted copy.

    The copy's name is a hash of the file's content (folders) or of place, size and time of change (.npz, USD).
    """
    identity, opened = source.opened(number)
    if cache is None:
        return source.parsed(number, opened)
    return cached_mesh(cache, _key(identity), lambda: source.parsed(number, opened))


def load_place(number: int, *, source: FrameSource, units: str, up: str, cache: Path) -> FloatArray:
    """Where one frame is, in metres and z up (see `areas.place_of`), as it is kept beside its converted copy.

    Raises:
        CaptureError: the frame cannot be read or used.
    """
    identity, _ = source.opened(number)
    key = _key(f"{PLACES}:{units}:{up}:{identity}")
    return cached_place(
        cache, key, lambda: place_of(load_frame(number, source=source, units=units, up=up, cache=cache))
    )


def _key(identity: str) -> str:
    """The name of the file in which something about a frame is kept."""
    return hashlib.blake2b(f"{VERSION}:{identity}".encode(), digest_size=20).hexdigest()
