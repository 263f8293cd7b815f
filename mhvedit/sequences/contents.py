"""What files hold, as hashes; a file that has not changed since is not read again."""

import hashlib
import json
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from mhvedit.files import replacing

SETTLED: Final = 2_000_000_000  # ns; a file that changed so recently may change again without another time of change
LARGE: Final = 1 << 26  # bytes; larger files are hashed piece by piece
Stamp = tuple[int, int, int, int]  # size, times of change of content and of the file (ns), inode


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """Hashes of files, remembered by place, size, times of change and inode.

    A folder that was moved, copied or touched has the same hashes; a file whose content changed never has.
    """

    memory: Path | None  # where the hashes are remembered; None: stamps stand in for them, for one process only
    known: dict[str, tuple[Stamp, str]] = field(default_factory=dict)
    fresh: set[str] = field(default_factory=set)  # hashed since they were last saved

    def of(self, files: Iterable[Path]) -> str:
        """One hash for the contents and formats of files, in this order.

        Args:
            files: that can be read.
        """
        return hashlib.blake2b(repr([self._of(file) for file in files]).encode(), digest_size=16).hexdigest()

    def save(self) -> None:
        """Remember for later runs."""
        if self.memory is not None and self.fresh:
            self.memory.parent.mkdir(parents=True, exist_ok=True)
            with replacing(self.memory) as beside:
                beside.write_text(json.dumps(self.known))
            self.fresh.clear()

    def hash_of(self, file: Path) -> tuple[str, bytes | None]:
        """The hash of one file, and its content if it was read for that, as that of a small one is.

        Raises:
            OSError: it cannot be read.
        """
        stamp = stamp_of(file)
        place = str(file.absolute())
        known, data = self.known.get(place), None
        if known is None or known[0] != stamp:
            data = None if stamp[0] > LARGE else file.read_bytes()
            known = stamp, _hash_in_pieces(file) if data is None else hash_of_bytes(data)
            if time.time_ns() - max(stamp[1:3]) > SETTLED:
                self.known[place] = known
                self.fresh.add(place)
        return known[1], data

    def _of(self, file: Path) -> tuple[str, object]:
        if self.memory is None:
            return str(file), stamp_of(file)
        return file.suffix.lower(), self.hash_of(file)[0]


def contents(memory: Path | None) -> Contents:
    """The hashes that earlier runs remembered; none where the memory is missing or damaged.

    Args:
        memory: a file, or None.
    """
    try:
        told = {} if memory is None else json.loads(memory.read_text())
        known = {place: (_stamp(*stamp), str(name)) for place, (stamp, name) in told.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        known = {}
    return Contents(memory, known)


def hash_of_bytes(data: bytes) -> str:
    """The hash of a file that holds these bytes."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _hash_in_pieces(file: Path) -> str:
    """The same of a file that is never whole in memory."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _stamp(size: int, mtime: int, ctime: int, inode: int) -> Stamp:
    return int(size), int(mtime), int(ctime), int(inode)


def stamp_of(file: Path) -> Stamp:
    """What of a file's state tells whether it has changed."""
    stat = file.stat()
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino
