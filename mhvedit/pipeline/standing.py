"""What earlier runs left in the output folder, and whether it still is what they wrote."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from mhvedit.pipeline.folders import EDIT, SOURCE
from mhvedit.pipeline.output import CACHE, solutions_path, write_json

LEDGER = f"{CACHE}/finished.json"
Stamp = list[int]  # size and time of change


@dataclass(frozen=True, slots=True)
class Standing:
    """The answer that stands in an output folder."""

    answer: str = ""  # name of everything that it depends on
    solutions: dict[str, str] = field(default_factory=dict)  # by segment, the name of its solutions
    files: dict[str, Stamp] = field(default_factory=dict)  # as they were when they were written


def standing_in(out: Path) -> Standing:
    """What stands in an output folder as it was written; files that somebody touched since are left out."""
    try:
        told = json.loads((out / LEDGER).read_text())
        files = {name: stamp for name, stamp in told["files"].items() if _stamp(out / name) == stamp}
        return Standing(str(told["answer"]), dict(told["solutions"]), files)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return Standing()


def forget(out: Path) -> None:
    """Before files are replaced: a run that is killed in the middle leaves nothing that counts as written."""
    (out / LEDGER).unlink(missing_ok=True)


def note(out: Path, answer: str, solutions: dict[str, str], names: Iterable[str]) -> None:
    """Once they are replaced.

    Args:
        out: output folder.
        answer: name of everything that it depends on.
        solutions: by segment, the name of its solutions.
        names: of the files that are there now.
    """
    files = {name: stamp for name in names if (stamp := _stamp(out / name)) is not None}
    write_json(out / LEDGER, {"answer": answer, "solutions": solutions, "files": files})


def holds(standing: Standing, names: Iterable[str]) -> bool:
    """Whether files are there as they were written."""
    return set(names) <= standing.files.keys()


def answer_files(segments: Iterable[str], *, solved: bool) -> list[str]:
    """The files of an answer, reports apart."""
    return [SOURCE, *([EDIT] if solved else []), *map(solutions_path, segments)]


def _stamp(file: Path) -> Stamp | None:
    try:
        stat = file.stat()
    except OSError:
        return None
    return [stat.st_size, stat.st_mtime_ns]
