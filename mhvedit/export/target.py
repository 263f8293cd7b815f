"""Where an export goes: which format a name asks for, and how its files get there: all of them or none."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Final

from mhvedit.errors import MhveditError

MARK: Final = "export.json"  # in a folder that an export has written


class ExportError(MhveditError, ValueError):
    """An export cannot be made as it is asked for."""

    def __init__(self, path: Path | str, expected: str, found: str) -> None:
        super().__init__(f"{path}: expected {expected}, found {found}")
        self.path, self.expected, self.found = Path(path), expected, found


class Format(StrEnum):
    """What an export is made of."""

    USD = "usd"
    GLB = "glb"
    MOVIE = "mp4"
    FOLDER = "folder"


BY_SUFFIX: Final = {
    ".usd": Format.USD,
    ".usda": Format.USD,
    ".usdc": Format.USD,
    ".usdz": Format.USD,
    ".glb": Format.GLB,
    ".mp4": Format.MOVIE,
    "": Format.FOLDER,
}


def format_of(path: Path) -> Format:
    """What a name asks for; a name without an extension, or of a folder that is there, is a folder.

    Raises:
        ExportError: another extension.
    """
    if path.is_dir():
        return Format.FOLDER
    try:
        return BY_SUFFIX[path.suffix.lower()]
    except KeyError:
        known = " ".join(suffix for suffix in BY_SUFFIX if suffix)
        raise ExportError(path, f"a name ending in {known}, or a folder's", repr(path.suffix)) from None


def check_free(path: Path, *, force: bool) -> None:
    """Refuse to write over what somebody may want to keep.

    Args:
        path: of the export.
        force: a file, or a folder that an export has written, may be replaced.

    Raises:
        ExportError: something is there that may not be replaced, or the folder around it is not.
    """
    parent = path.parent
    if not parent.is_dir():
        raise ExportError(path, f"a folder {parent} to write into", "a file" if parent.exists() else "nothing there")
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        return
    if path.is_dir() and not (path / MARK).is_file():
        raise ExportError(path, "a new folder, or one that `mhvedit export` has written", "a folder of other files")
    if not force:
        what = "a folder" if path.is_dir() else "a file"
        raise ExportError(path, "nothing there, or --force to write over it", what)


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """A folder beside the target, for files that are being written; gone at the end, whatever happens.

    Args:
        path: of the export.
    """
    beside = path.parent / f".{path.name}.{os.getpid()}.part"
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir()
    try:
        yield beside
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def put_file(made: Path, path: Path) -> None:
    """Put a file that is complete in its place."""
    os.replace(made, path)


def put_folder(made: Path, path: Path) -> None:
    """Put a folder that is complete in its place; what an earlier export left there goes."""
    old = made.with_name(f"{made.name}.old")
    if path.exists():
        os.replace(path, old)
    try:
        os.replace(made, path)
    except OSError:
        if old.exists():
            os.replace(old, path)
        raise
    shutil.rmtree(old, ignore_errors=True)


def mark_folder(folder: Path, facts: dict[str, object]) -> None:
    """Say in a folder what it is, so that a later export may replace it."""
    (folder / MARK).write_text(json.dumps(facts, indent=1) + "\n")
