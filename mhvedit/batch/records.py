"""What earlier runs of a batch finished, under a key made of all that it depends on."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

from mhvedit import __version__
from mhvedit.errors import MhveditError
from mhvedit.pipeline.output import CACHE, write_json
from mhvedit.pipeline.run import VERSION
from mhvedit.pipeline.store import hashed
from mhvedit.project.schema import FilePath, SceneFile
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.read import USD_SUFFIXES
from mhvedit.sequences.usd import stage_files

RECORDS = f"{CACHE}/batch"


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What the files that scenes name hold; each place is looked at once in a run."""

    contents: Contents
    known: dict[Path, str] = field(default_factory=dict)  # hashes by file or folder

    def key(self, scene: SceneFile, *options: object) -> str:
        """Changes when anything does that a finished scene depends on."""
        held = [self._of(path) for path in named_paths(scene)]
        return hashed((__version__, VERSION, scene, held, options))

    def _of(self, path: Path) -> str:
        if path not in self.known:
            files = _files_in(path)
            self.known[path] = self.contents.of(files) + hashed([file.name for file in files])
        return self.known[path]


def _files_in(path: Path) -> list[Path]:
    """All files of a folder, or a file with all that it is read together with."""
    if not path.is_file():
        return sorted(file for file in path.rglob("*") if file.is_file())
    if path.suffix.lower() not in USD_SUFFIXES:
        return [path]
    try:
        return list(stage_files(path))
    except MhveditError:  # told where the scene is solved
        return [path]


def named_paths(value: object) -> Iterator[Path]:
    """All files and folders that a scene file names, in its order."""
    if isinstance(value, FilePath):
        yield value.path
    elif is_dataclass(value):
        for entry in fields(value):
            yield from named_paths(getattr(value, entry.name))
    elif isinstance(value, dict):
        for entry in value.values():
            yield from named_paths(entry)
    elif isinstance(value, tuple):
        for entry in value:
            yield from named_paths(entry)


def recorded(out: Path, name: str, key: str) -> dict[str, Any] | None:
    """What was recorded under a name; None where that is of another key, or damaged."""
    try:
        told = json.loads((out / RECORDS / f"{name}.json").read_text())
        return dict(told["content"]) if told["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def record(out: Path, name: str, key: str, content: dict[str, Any]) -> None:
    """Record something under a name."""
    (out / RECORDS).mkdir(parents=True, exist_ok=True)
    write_json(out / RECORDS / f"{name}.json", {"key": key, "content": content})
