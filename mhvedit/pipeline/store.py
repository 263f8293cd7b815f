"""Results kept in the output folder between runs, under a key made of everything that they depend on."""

import hashlib
import logging
import os
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mhvedit.sequences.meshes import MeshSequence

LOG = logging.getLogger(__name__)
DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError)
Arrays = Mapping[str, "np.ndarray[Any, Any]"]


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of results; what is damaged is made again, and so is everything without a folder."""

    folder: Path | None

    def arrays(self, key: object, build: Callable[[], Arrays]) -> dict[str, "np.ndarray[Any, Any]"]:
        """Arrays from an earlier run with the same key, or built now and kept.

        Args:
            key: everything that the result depends on; its `repr` is hashed.
            build: makes the arrays.
        """
        if self.folder is None:
            return dict(build())
        path = self.folder / f"{hashed(key)}.npz"
        kept = _read(path)
        if kept is None:
            kept = dict(build())
            _write(path, kept)
        return kept

    def has(self, key: object) -> bool:
        """Whether a result with this key is kept."""
        return self.folder is not None and (self.folder / f"{hashed(key)}.npz").exists()


def hashed(key: object) -> str:
    """A name for a key."""
    return hashlib.blake2b(repr(key).encode(), digest_size=16).hexdigest()


def capture_signature(sequence: MeshSequence, *, units: str, up: str) -> tuple[object, ...]:
    """What tells whether a capture has changed: its files by place, size and time, its frames, rate, units and axes."""
    return (*file_signatures(sequence.files), sequence.numbers, sequence.fps, units, up)


def file_signatures(files: tuple[Path, ...]) -> tuple[object, ...]:
    """Place, size and time of files."""
    return tuple((str(file), (stat := file.stat()).st_size, stat.st_mtime_ns) for file in files)


def _read(path: Path) -> dict[str, "np.ndarray[Any, Any]"] | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except FileNotFoundError:
        return None
    except DAMAGED as fault:
        LOG.warning("%s is damaged and is made again: %s", path, fault)
        return None


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.stem}.{os.getpid()}.part")
    try:
        with beside.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
