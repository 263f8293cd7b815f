"""Changes single values of a scene file; comments and layout stay as they are."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import tomlkit
from tomlkit import TOMLDocument
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Item, SingleKey, Table

from mhvedit.errors import SceneError
from mhvedit.files import replacing
from mhvedit.project.scene_file import parse_scene, read_text
from mhvedit.project.schema import SceneFile

NEWLINE: Final = "\n"
Place = tuple[str | int, ...]  # ("segments", 3, "visibility", "half_angle"); segments counted from 0
Setting = bool | int | float | str | list["Setting"] | dict[str, "Setting"] | None


def save_changes(path: Path | str, changes: Mapping[Place, Setting]) -> SceneFile:
    """Change values of a scene file on disk, all at once or, if the result would be no scene file, none.

    Args:
        path: the scene file.
        changes: by place in the file, in the file's own terms (degrees, inclusive frames). A table that is not
            there, or stands as `false` or "auto", is made. None takes a value out, so that its default holds, or a
            whole segment, with the comments behind it.

    Returns:
        The scene as it is now.

    Raises:
        SceneError: there is no such place, or the changed file would not load; the file is as it was.
    """
    path = Path(path)
    before = read_text(path)
    parse_scene(before, path)
    windows = 0 < before.count("\n") == before.count("\r\n")
    after = before.replace("\r\n", "\n") if windows else before
    for place, value in changes.items():
        try:
            after = _changed(after, place, value)
        except (KeyError, IndexError, TypeError, AttributeError, ValueError, TOMLKitError) as error:
            raise SceneError(path, _said(place), "a place in the scene file", " ".join(str(error).split())) from error
    scene = parse_scene(after, path)
    _write(path.resolve(), after.replace("\n", "\r\n") if windows else after)
    return scene


def _changed(content: str, place: Place, value: Setting) -> str:
    """The file with one value changed."""
    document: Any = tomlkit.parse(content)
    *way, last = place
    inside = document
    for step in way:
        if isinstance(step, str) and not isinstance(inside.get(step), dict | list):
            if value is None:
                return content
            if step != way[-1]:
                raise KeyError(f"nothing called {step}")
            made = tomlkit.table() if inside is document else tomlkit.inline_table()
            made[str(last)] = _item(value)
            _set(inside, step, made)
            return tomlkit.dumps(document)
        inside = inside[step]
    if value is not None:
        _set(inside, last, _item(value))
    elif isinstance(last, int) or last in inside:
        del inside[last]
    return tomlkit.dumps(document)


def _set(inside: Any, key: str | int, item: Item) -> None:  # noqa: ANN401 - whatever tomlkit has there
    """Replace a value; a new key goes right behind the last one: comments after that belong to what follows."""
    table = isinstance(inside, Table) and not inside.is_super_table()
    body = inside.value.body if table else inside.body if isinstance(inside, TOMLDocument) else []
    plain = [entry for name, entry in body if name is not None and not isinstance(entry, Table | AoT)]
    if isinstance(key, int) or isinstance(item, Table) or key in inside or not (plain or table):
        inside[key] = item
        return
    trivia = (plain[-1] if plain else inside).trivia
    trivia.trail = f"{trivia.trail or NEWLINE}{SingleKey(key).as_string()} = {item.as_string()}\n"


def _item(value: Setting) -> Item:
    """Tables and lists in one line, as scene files have them."""
    if isinstance(value, list):
        several = tomlkit.array()
        several.extend(_item(entry) for entry in value)
        return several
    if not isinstance(value, dict):
        return tomlkit.item(value)
    made = tomlkit.inline_table()
    for key, entry in value.items():
        made[key] = _item(entry)
    return made


def _said(place: Place) -> str:
    """A place as errors have it."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place).lstrip(".")


def _write(file: Path, content: str) -> None:
    """All of it or nothing: written beside, then renamed."""
    with replacing(file) as beside:
        beside.write_bytes(content.encode())
        shutil.copymode(file, beside)
