"""Templates: one scene file, and what is to be put into its places, in all combinations."""

import math
import os
import re
import tomllib
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomlkit

from mhvedit.errors import SceneError
from mhvedit.pipeline.store import hashed
from mhvedit.project.scene_file import read_text
from mhvedit.project.values import Value, dotted, fields, file_path, listed, number, shown, table, whole

KEYS: Final[Mapping[str, Any]] = {"scene": None, "solutions": 1, "seeds": [], "parameters": {}}
PATH_KEYS: Final = ("path", "track", "eye", "target", "skeleton", "facing")  # of subjects and props
MOST_SCENES: Final = 100_000
LONGEST: Final = 80  # characters of a scene's name
DIGITS: Final = 6  # of a number that is drawn
Settings = Mapping[str, Any]  # by place in the scene file, dotted


@dataclass(frozen=True, slots=True)
class Choice:
    """One value that a parameter may have."""

    label: str  # in the names of scenes
    settings: Settings


@dataclass(frozen=True, slots=True)
class Drawn:
    """A parameter that every seed draws anew, evenly between two numbers."""

    place: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Template:
    """A scene file and what is to be put into it."""

    file: Path
    scene: Path
    solutions: int
    seeds: tuple[int, ...]
    choices: tuple[tuple[Choice, ...], ...]  # by parameter
    drawn: tuple[Drawn, ...]


def is_template(content: Mapping[str, Any]) -> bool:
    """Whether the content of a TOML file is a template rather than a scene file."""
    return "scene" in content and "version" not in content


def read_template(path: Path) -> Template:
    """Read a template; paths in it, and in what it puts into the scene file, are relative to their own file.

    Args:
        path: the .toml file.

    Raises:
        SceneError: one sentence: file, key, what was expected, what is there.
    """
    at = Value(path, "", tomllib.loads(read_text(path)))
    entries = fields(at, KEYS)
    seeds = entries["seeds"]
    if not isinstance(seeds.value, list):
        raise seeds.error("a list of whole numbers")
    choices: list[tuple[Choice, ...]] = []
    drawn: list[Drawn] = []
    for name, value in table(entries["parameters"]).items():
        entry = entries["parameters"].at(name, value)
        if isinstance(value, dict):
            drawn.append(_drawn(name, entry))
        else:
            choices.append(_choices(name, entry))
    template = Template(
        file=path,
        scene=file_path(entries["scene"], "a scene file").path,
        solutions=whole(entries["solutions"], least=1),
        seeds=tuple(whole(seeds.at(i, value), least=0) for i, value in enumerate(seeds.value)),
        choices=tuple(choices),
        drawn=tuple(drawn),
    )
    if bool(template.drawn) != bool(template.seeds):
        raise seeds.error("seeds where a parameter is drawn between two numbers, and only there")
    count = math.prod(map(len, choices)) * max(1, len(template.seeds))
    if count > MOST_SCENES:
        raise entries["parameters"].error(f"at most {MOST_SCENES:,} scenes", f"combinations for {count:,}")
    return template


def made_scenes(template: Template, out: Path) -> dict[str, str]:
    """The scene files of a template, by the names of their scenes.

    Names are made of the values that were put in, so that one more value leaves the names of the other scenes as
    they are.

    Args:
        template: read.
        out: output folder of the batch; the file of a scene is to lie in the folder of that name in there.

    Raises:
        SceneError: the scene file is no TOML, or a place is not there.
    """
    content = Value(template.scene, "scene file", _parsed(template.scene))
    made = list(_combinations(template))
    names = _names(template.scene.stem, made)
    return {
        name: tomlkit.dumps(_filled(template, content.value, settings | {"name": name}, out / name))
        for name, (_, settings) in zip(names, made, strict=True)
    }


def moved_content(content: Mapping[str, Any], old: Path, new: Path) -> dict[str, Any]:
    """The content of a scene file for another folder: relative paths are changed so that they lead where they led.

    Args:
        content: as TOML has it.
        old: folder of the scene file.
        new: folder that it is to lie in.
    """
    return {
        name: _rebased(entry, old, new) if name in ("subjects", "props") else entry for name, entry in content.items()
    }


def _parsed(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(read_text(path))
    except ValueError as error:
        raise SceneError(path, "scene file", "valid TOML", f"a mistake: {' '.join(str(error).split())}") from error


def _choices(name: str, at: Value) -> tuple[Choice, ...]:
    """A list of values for a place, or, under a name without dots, of tables of places with their values."""
    if not isinstance(at.value, list) or not at.value:
        raise at.error("a list of values, or {between = [low, high]}")
    if "." in name:
        labels = [_slug(value, i) for i, value in enumerate(at.value)]
        choices = [Choice(label, {name: value}) for label, value in zip(labels, at.value, strict=True)]
    else:
        settings = [table(at.at(i, value)) for i, value in enumerate(at.value)]
        choices = [Choice(f"{name}{i + 1}", entry) for i, entry in enumerate(settings)]
    return tuple(choices)


def _drawn(name: str, at: Value) -> Drawn:
    between = fields(at, {"between": None})["between"]
    if not isinstance(between.value, list) or len(between.value) != 2:
        raise between.error("[low, high]")
    low, high = (number(between.at(i, value)) for i, value in enumerate(between.value))
    if low > high:
        raise between.error("[low, high], low <= high")
    return Drawn(name, low, high)


def _combinations(template: Template) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    """Labels and settings of every scene."""
    seeds: Sequence[int | None] = template.seeds or (None,)
    for picked in product(*template.choices):
        settings = {place: value for choice in picked for place, value in choice.settings.items()}
        labels = tuple(choice.label for choice in picked)
        for seed in seeds:
            if seed is None:
                yield labels, settings
            else:
                yield (*labels, f"seed{seed}"), settings | {d.place: _draw(d, seed) for d in template.drawn}


def _draw(drawn: Drawn, seed: int) -> float:
    """A number that depends on the seed and on the place alone."""
    generator = np.random.default_rng([seed, zlib.crc32(drawn.place.encode())])
    return float(f"{generator.uniform(drawn.low, drawn.high):.{DIGITS}g}")


def _names(stem: str, made: Sequence[tuple[tuple[str, ...], Settings]]) -> list[str]:
    """A name for every scene; where labels give too long a one, or twice the same, a hash of the settings helps."""
    plain = ["-".join((stem, *labels)) for labels, _ in made]
    count = Counter(plain)
    return [
        name if count[name] == 1 and len(name) <= LONGEST else f"{name[:LONGEST]}-{hashed(settings)[:8]}"
        for name, (_, settings) in zip(plain, made, strict=True)
    ]


def _slug(value: object, index: int) -> str:
    """A value as part of a file name."""
    if isinstance(value, dict | list):
        return str(index + 1)
    signs = {"+": "p", "-": "m", "&": ""} if isinstance(value, str) and "&" in value else {}
    written = "".join(signs.get(letter, letter) for letter in str(value))
    return re.sub(r"[^\w.-]+", "_", Path(written).name).strip("._-") or str(index + 1)


def _filled(template: Template, content: dict[str, Any], settings: Settings, folder: Path) -> dict[str, Any]:
    """The scene file with settings put in, for another folder."""
    filled = deepcopy(content)
    for place, value in settings.items():
        _put(filled, place, value, template.file)
    return moved_content(filled, template.scene.parent, folder)


def _put(content: dict[str, Any], place: str, value: object, file: Path) -> None:
    """Put a value into its place; tables on the way there are made, segments and subjects are not."""
    *way, last = _steps(place, file)
    inside: Any = content
    for depth, step in enumerate(way):
        if isinstance(inside, list):
            named = {str(entry.get("name")): entry for entry in inside if isinstance(entry, dict)}
            inside = _there(named, step, place, file)
        elif depth == 1 and way[0] in ("subjects", "props"):
            inside = _there(inside, step, place, file)
        else:
            inside = inside.setdefault(step, {})
        if not isinstance(inside, dict | list):
            raise SceneError(file, f"parameters.{place}", "a place in the scene file", f"{shown(inside)} on the way")
    if isinstance(inside, list):
        raise SceneError(file, f"parameters.{place}", "a key in an entry of a list", "the entry alone")
    inside[last] = value


def _there(entries: Mapping[str, Any], step: str, place: str, file: Path) -> Any:  # noqa: ANN401 - as TOML has it
    if step not in entries:
        raise SceneError(file, f"parameters.{place}", listed(map(str, entries)), dotted("", step))
    return entries[step]


def _steps(place: str, file: Path) -> list[str]:
    """The keys of a dotted place, quoted as TOML has them."""
    try:
        inside: Any = tomllib.loads(f"{place} = 0")
    except ValueError:
        raise SceneError(file, f"parameters.{place}", "a dotted key of the scene file", shown(place)) from None
    steps = []
    while isinstance(inside, dict):
        ((step, inside),) = inside.items()
        steps.append(step)
    return steps


def _rebased(value: Any, old: Path, new: Path, key: str = "") -> Any:  # noqa: ANN401 - as TOML has it
    """The same with relative paths from another folder."""
    if isinstance(value, dict):
        return {name: _rebased(entry, old, new, name) for name, entry in value.items()}
    if isinstance(value, list):
        return [_rebased(entry, old, new, "" if isinstance(entry, str) else key) for entry in value]
    if isinstance(value, str) and key in PATH_KEYS and not (key == "facing" and value == "auto"):
        return value if os.path.isabs(value) else os.path.relpath(old.absolute() / value, new.absolute())
    return value
