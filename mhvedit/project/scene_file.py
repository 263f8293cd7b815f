"""Reads a scene file, and checks all that can be checked without opening a capture."""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from mhvedit.errors import SceneError
from mhvedit.project.schema import OptimiseSettings, SceneFile, SearchSettings, SubjectSpec
from mhvedit.project.segment_keys import check_visible_frames, segment_specs
from mhvedit.project.stage_keys import prop_specs, stage_spec
from mhvedit.project.subject_keys import subject_spec
from mhvedit.project.values import Value, fields, named, number, text

VERSION: Final = 1
KEYS: Final[Mapping[str, Any]] = {
    "version": None,
    "name": None,
    "fps": None,
    "subjects": None,
    "segments": None,
    "search": {},
    "optimise": {},
    "stage": {},
    "props": {},
}
NEARLY: Final = 1e-6  # by which a quotient of decimals may miss the whole number that it is meant to be


def load_scene(path: Path | str) -> SceneFile:
    """Read a scene file (`docs/scene-file.md`).

    Paths in it are relative to its folder; that what they name is there is checked, captures are not opened.

    Args:
        path: the .toml file.

    Raises:
        SceneError: one sentence: file, key (segments counted from 0), what was expected, what is there.
    """
    path = Path(path)
    return parse_scene(read_text(path), path)


def read_text(path: Path) -> str:
    """The text of a scene file, line ends as they are.

    Raises:
        SceneError: no such file, or not a text.
    """
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        found = "nothing" if isinstance(error, FileNotFoundError) else str(error.strerror)
        raise SceneError(path, "scene file", "a TOML file", found) from error
    except UnicodeDecodeError as error:
        raise SceneError(path, "scene file", "text in UTF-8", f"another byte at place {error.start}") from error


def parse_scene(content: str, path: Path) -> SceneFile:
    """Check the text of a scene file.

    Args:
        content: TOML.
        path: the file that it is, or will be, the content of.

    Raises:
        SceneError: as `load_scene`.
    """
    whole = Value(path, "", _parsed(content, path))
    version = whole.at("version", whole.value.get("version"))
    if version.value != VERSION or isinstance(version.value, bool):
        raise version.error(str(VERSION))
    entries = fields(whole, KEYS)
    subjects = _subjects(entries["subjects"])
    scene = SceneFile(
        file=path,
        name=text(entries["name"]),
        fps=_fps(entries["fps"], subjects),
        subjects=subjects,
        segments=segment_specs(entries["segments"], subjects),
        search=_search(entries["search"]),
        optimise=_optimise(entries["optimise"]),
        stage=stage_spec(entries["stage"], subjects),
        props=prop_specs(entries["props"], subjects),
    )
    _check_visible_frames(scene)
    return scene


def _parsed(content: str, path: Path) -> dict[str, Any]:
    """The content as TOML has it."""
    try:
        return tomllib.loads(content)
    except (ValueError, RecursionError) as error:
        said = " ".join(str(error).split())
        where = re.search(r" \(at (line \d+, column \d+|end of document)\)$", said)
        found = said[: where.start()] if where else said
        raise SceneError(path, where[1] if where else "scene file", "valid TOML", f"a mistake: {found}") from error


def _subjects(at: Value) -> dict[str, SubjectSpec]:
    """Two subjects or more."""
    tables = named(at) if at.value is not None else {}
    if len(tables) < 2:
        raise at.error("at least two [subjects.<name>]", ", ".join(tables) or "none")
    return {name: subject_spec(entry, name) for name, entry in tables.items()}


def _fps(at: Value, subjects: Mapping[str, SubjectSpec]) -> float | None:
    """Of the edited scene."""
    return next(iter(subjects.values())).fps if at.value is None else number(at, above=0)


def _check_visible_frames(scene: SceneFile) -> None:
    """Where all rates are in the file; others are known when the captures are open."""
    for segment in scene.segments:
        a, b = (scene.subjects[who].fps for who in segment.between)
        if scene.fps is not None and a is not None and b is not None:
            check_visible_frames(scene.file, segment, fps=scene.fps, rates=(a, b))


def _search(at: Value) -> SearchSettings:
    """The grid; `yaw_step` in degrees becomes radians."""
    entries = fields(at, asdict(SearchSettings()) | {"yaw_step": 2})
    voxel = number(entries["voxel"], above=0)
    step = number(entries["step"], above=0)
    yaw_step = number(entries["yaw_step"], above=0, most=360)
    if not _is_whole(step / voxel):
        raise entries["step"].error(f"a whole multiple of search.voxel, {voxel:g}")
    if not _is_whole(360 / yaw_step):
        raise entries["yaw_step"].error("degrees that divide 360")
    return SearchSettings(voxel, step, math.tau / round(360 / yaw_step), number(entries["window"], above=0))


def _is_whole(ratio: float) -> bool:
    """Whether a quotient of decimals is a whole number of at least 1."""
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < NEARLY * ratio


def _optimise(at: Value) -> OptimiseSettings:
    """The weights."""
    entries = fields(at, asdict(OptimiseSettings()))
    return OptimiseSettings(
        facing_weight=number(entries["facing_weight"], least=0),
        acceleration=number(entries["acceleration"], least=0, most=1),
        alpha=number(entries["alpha"], least=0),
        slow_speed=number(entries["slow_speed"], least=0),
        slow_turn=number(entries["slow_turn"], least=0),
    )
