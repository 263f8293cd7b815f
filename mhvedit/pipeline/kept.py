"""The cache of an output folder as a whole: what is kept there, how much of it, and what goes first."""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mhvedit.errors import MhveditError
from mhvedit.pipeline.output import CACHE
from mhvedit.sequences.cache import PLACE

LIMIT: Final = 8.0  # GB
VARIABLE: Final = "MHVEDIT_CACHE_LIMIT"  # GB, of the environment
GB: Final = 1e9
FRAMES: Final = "frames"  # converted meshes; other stages are folders of `results`


class CacheLimitError(MhveditError, ValueError):
    """The size limit of the cache is no size."""

    def __init__(self, found: str) -> None:
        super().__init__(f"{VARIABLE}: expected a number of GB, 0 or more, found {found!r}")
        self.found = found


@dataclass(frozen=True, slots=True)
class Entry:
    """One kept file."""

    file: Path
    stage: str
    size: int  # bytes
    used: float  # s since 1970, when it was last read or written


@dataclass(frozen=True, slots=True)
class StageSummary:
    """All that is kept of one stage."""

    stage: str
    entries: int
    size: int  # bytes
    oldest: float  # s since it was last used
    newest: float


def entries_in(out: Path) -> list[Entry]:
    """All that is kept in an output folder, least recently used first."""
    cache = out / CACHE
    found = []
    for file in [
        *(cache / "results").glob("*/*.npz"),
        *(cache / FRAMES).glob("*.npz"),
        *(cache / FRAMES).glob(f"*{PLACE}"),
    ]:
        try:
            stat = file.stat()
        except FileNotFoundError:  # another run has just taken it away
            continue
        found.append(Entry(file, file.parent.name, stat.st_size, max(stat.st_mtime, stat.st_atime)))
    return sorted(found, key=lambda entry: entry.used)


def summaries(entries: list[Entry]) -> list[StageSummary]:
    """By stage, largest first."""
    now = time.time()
    by_stage: dict[str, list[Entry]] = {}
    for entry in entries:
        by_stage.setdefault(entry.stage, []).append(entry)
    found = [
        StageSummary(stage, len(own), sum(e.size for e in own), now - own[0].used, now - own[-1].used)
        for stage, own in by_stage.items()
    ]
    return sorted(found, key=lambda summary: (-summary.size, summary.stage))


def trim(out: Path, *, limit: float, since: float) -> int:
    """Take away what was not used for longest until the cache is small enough; converted frames go last.

    Args:
        out: output folder.
        limit: GB.
        since: s since 1970; what was used since then stays, even if that is too much.

    Returns:
        Bytes that were freed.
    """
    entries = entries_in(out)
    excess = sum(entry.size for entry in entries) - limit * GB
    freed = 0
    for entry in sorted(entries, key=lambda entry: (entry.stage == FRAMES, entry.used)):
        if freed < excess and entry.used < since:
            entry.file.unlink(missing_ok=True)
            freed += entry.size
    return freed


def clear(out: Path) -> int:
    """Take away everything that is kept; returns the bytes that were freed."""
    freed = 0
    for entry in entries_in(out):
        entry.file.unlink(missing_ok=True)
        freed += entry.size
    (out / CACHE / "contents.json").unlink(missing_ok=True)
    return freed


def cache_limit() -> float:
    """GB, from the environment or the default.

    Raises:
        CacheLimitError: the variable holds no size.
    """
    told = os.environ.get(VARIABLE, "")
    if not told:
        return LIMIT
    try:
        limit = float(told)
    except ValueError:
        raise CacheLimitError(told) from None
    if not limit >= 0:
        raise CacheLimitError(told)
    return limit
