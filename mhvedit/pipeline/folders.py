"""Whose output folder one is: that of `mhvedit solve`, that of `mhvedit avoid`, or nobody's."""

import json
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from mhvedit.errors import CaptureError, MhveditError

EDIT, REPORT, PAGE, SOURCE = "edit.json", "report.json", "report.html", "scene.json"
AVOIDED: Final = frozenset({"motion", "method", "converged", "why", "pairs"})  # keys that only reports of `avoid` have


class Owner(StrEnum):
    """Commands that write an output folder."""

    SOLVE = "`mhvedit solve`"
    AVOID = "`mhvedit avoid`"


class NoAnswer(MhveditError, ValueError):
    """`mhvedit solve` found none for the scene of an output folder."""

    def __init__(self, folder: Path, failure: str, told_in: str) -> None:
        super().__init__(f"{folder}: no answer: {failure}; see {told_in}")
        self.folder, self.failure = folder, failure


def report_in(folder: Path) -> Mapping[str, Any]:
    """The content of `report.json`; nothing where it is not there or none."""
    try:
        found = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def noted_scene(folder: Path) -> Path | None:
    """The scene file that `mhvedit solve` noted, as it is told, without detours; None where that cannot be read."""
    try:
        told: str = json.loads((folder / SOURCE).read_text())["scene"]
        return (folder / told).resolve()
    except (OSError, ValueError, KeyError, TypeError):
        return None


def is_of_motion(report: Mapping[str, Any]) -> bool:
    """Whether a report is one of `mhvedit avoid`."""
    return set(report) >= AVOIDED


def is_motion_folder(folder: Path) -> bool:
    """Whether `mhvedit avoid` wrote a folder."""
    return is_of_motion(report_in(folder))


def check_answered(folder: Path, *, to_be: str) -> None:
    """Refuse a folder that has no edit and says why; one that does not say is left to who reads the edit.

    Args:
        folder: of the output.
        to_be: what is to become of the scene, for the message: `checked`.

    Raises:
        NoAnswer: nothing fitted.
        CaptureError: `mhvedit avoid` wrote it.
    """
    if (folder / EDIT).is_file():
        return
    report = report_in(folder)
    if is_of_motion(report):
        raise CaptureError(
            folder, f"an output folder of {Owner.SOLVE}", f"one of {Owner.AVOID}; only scenes are {to_be}"
        )
    if report.get("solved") is False:
        told_in = PAGE if (folder / PAGE).is_file() else REPORT
        raise NoAnswer(folder, str(report.get("failure") or "nothing fits"), told_in)


def check_owner(folder: Path, owner: Owner) -> None:
    """Refuse an output folder of the other command, whose files would be written over.

    Args:
        folder: that is to be written to.
        owner: who is to write.

    Raises:
        CaptureError: the other one wrote it.
    """
    solved = (folder / SOURCE).is_file()
    other = Owner.SOLVE if solved else Owner.AVOID if is_motion_folder(folder) else owner
    if other is not owner:
        raise CaptureError(folder, f"an output folder of {owner}, or a new one", f"one of {other}")
