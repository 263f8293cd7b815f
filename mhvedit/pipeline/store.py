"""Results kept in the output folder between runs, under a key made of everything that they depend on."""

import atexit
import hashlib
import logging
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from mhvedit.files import UNREADABLE, map_arrays, read_arrays, write_arrays
from mhvedit.sequences.contents import Contents, contents
from mhvedit.sequences.meshes import MeshSequence

LOG = logging.getLogger(__name__)
Key = tuple[object, ...]  # the stage's name first
Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Store:
    """Results by key: of this process, of an earlier one in it, and, with a folder, of earlier runs.

    What is damaged on disk is made again.
    """

    folder: Path | None  # entries are STAGE/HASH.npz
    contents: Contents
    earlier: Mapping[str, Arrays] = field(default_factory=dict)  # by name, of an earlier solve in this process
    used: dict[str, Arrays] = field(default_factory=dict)  # by name, what this one has made or read as a whole
    holds: bool = True  # whether `used` is filled; without it, and with a folder, memory stays small

    def arrays(self, key: Key, build: Callable[[], Arrays], *, names: tuple[str, ...] = ()) -> Arrays:
        """Arrays that are kept under a key, or built now and kept.

        Args:
            key: everything that the result depends on, its stage first; the `repr` is hashed.
            build: makes the arrays.
            names: which are asked for; none for all. Others are not read.
        """
        found = self.kept(key, names=names)
        return found if found is not None else self.keep(key, build())

    def kept(self, key: Key, *, names: tuple[str, ...] = ()) -> Arrays | None:
        """Arrays that are kept under a key, those asked for at least; None where there is no such result."""
        name = entry_name(key)
        found = self.used.get(name) or self.earlier.get(name)
        if found is None and self.folder is not None:
            found = _read(self.folder / f"{name}.npz", names)
            if names:
                return found
        if found is not None and self.holds:
            self.used[name] = found
        return found

    def keep(self, key: Key, arrays: Arrays) -> Arrays:
        """Keep arrays under a key, in place of others."""
        name = entry_name(key)
        if self.holds:
            self.used[name] = arrays
        if self.folder is not None:
            path = self.folder / f"{name}.npz"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_arrays(path, arrays)
        return arrays

    def carry(self, key: Key) -> None:
        """Hold on to a result of the earlier solve that this one had no need of."""
        name = entry_name(key)
        if name in self.earlier:
            self.used.setdefault(name, self.earlier[name])


def open_store(cache: Path | None) -> Store:
    """The results that are kept in a cache folder.

    Args:
        cache: of an output folder; None for a store that lasts as long as it is used.
    """
    memory = None if cache is None else cache / "contents.json"
    return Store(None if cache is None else cache / "results", contents(memory))


def kept_file(store: Store, key: Key, build: Callable[[], Arrays], *, told: str) -> Path:
    """The file that holds arrays which are kept under a key; without a folder, one that lasts as long as the process.

    Args:
        store: where they are kept.
        key: everything that they depend on.
        build: makes them.
        told: one of them, small.
    """
    if store.folder is None:
        folder = Path(tempfile.mkdtemp(prefix="mhvedit_"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        replace(store, folder=folder, holds=False).keep(key, store.arrays(key, build))
        return folder / f"{entry_name(key)}.npz"
    if store.kept(key, names=(told,)) is None:
        replace(store, holds=False).keep(key, build())
    return store.folder / f"{entry_name(key)}.npz"


def entry_name(key: Key) -> str:
    """Where a result is kept: its stage, and a hash of its key."""
    return f"{key[0]}/{hashed(key)}"


def hashed(key: object) -> str:
    """A name for a key."""
    return hashlib.blake2b(repr(key).encode(), digest_size=16).hexdigest()


def capture_signature(sequence: MeshSequence, known: Contents, *, units: str, up: str) -> Key:
    """What tells whether a capture has changed: what its files hold, its frames, rate, units and axes."""
    return (known.of(sequence.files), sequence.numbers, sequence.fps, units, up)


def _read(path: Path, names: tuple[str, ...]) -> Arrays | None:
    """An entry, or some arrays of it; it counts as used from now on."""
    try:
        read = map_arrays(path, names) if names else read_arrays(path)
        os.utime(path)
        return read
    except FileNotFoundError:
        return None
    except UNREADABLE as fault:
        LOG.warning("%s is damaged and is made again: %s", path, fault)
        return None
