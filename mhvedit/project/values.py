"""Single values of a scene file: each knows where it stands, so errors name file, key, expected and found."""

import json
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from mhvedit.errors import SceneError
from mhvedit.project.schema import FilePath

NAME: Final = "a name of letters, digits, . _ -"
LONGEST: Final = 60  # characters of a value that an error shows


@dataclass(frozen=True, slots=True)
class Value:
    """A value as TOML gives it, and where it stands."""

    file: Path
    key: str  # dotted
    value: Any  # None where the file has none: TOML knows no null

    def error(self, expected: str, found: str | None = None) -> SceneError:
        """The error to raise; `found` is the value itself unless said otherwise."""
        return SceneError(self.file, self.key, expected, shown(self.value) if found is None else found)

    def at(self, place: str | int, value: object) -> "Value":
        """A value inside this one."""
        return Value(self.file, f"{self.key}[{place}]" if isinstance(place, int) else dotted(self.key, place), value)


def dotted(key: str, name: str) -> str:
    """The key of a table's entry, quoted where TOML asks for it."""
    written = name if re.fullmatch(r"[\w-]+", name) else json.dumps(name, ensure_ascii=False)
    return f"{key}.{written}" if key else written


def shown(value: object) -> str:
    """A value as an error shows it: in one line, not too long."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case int() if abs(value) >= 2**63:
            return "a number beyond 64 bits"
        case str():
            text = json.dumps(value, ensure_ascii=False)
        case list():
            text = f"[{', '.join(map(shown, value))}]"
        case dict():
            text = "{" + ", ".join(f"{dotted('', str(key))} = {shown(v)}" for key, v in value.items()) + "}"
        case _:
            text = str(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


def suggestion(word: str, known: Iterable[str]) -> str:
    """A hint at the known word that was probably meant, or nothing."""
    plain = {name.casefold(): name for name in known}
    close = get_close_matches("".join(word.split()).casefold(), plain, n=1)
    return f' (did you mean "{plain[close[0]]}"?)' if close else ""


def listed(names: Iterable[str]) -> str:
    """One of several words."""
    words = list(names)
    return f"one of {', '.join(words)}" if len(words) > 1 else words[0] if words else "no name at all"


def fields(at: Value, defaults: Mapping[str, Any]) -> dict[str, Value]:
    """The entries of a table whose keys are known.

    Args:
        at: the table.
        defaults: every key that it may have, with what stands for it if it has not; None for nothing.

    Raises:
        SceneError: no table, or an unknown key.
    """
    inside = table(at)
    for key in inside:
        if key not in defaults:
            hint = suggestion(key, defaults)
            raise at.at(key, None).error(listed(defaults), f"an unknown key{hint}")
    return {key: at.at(key, inside.get(key, default)) for key, default in defaults.items()}


def named(at: Value) -> dict[str, Value]:
    """The entries of a table whose keys are names that the editor gives."""
    inside = {key: at.at(key, value) for key, value in table(at).items()}
    for key, entry in inside.items():
        if not is_name(key):
            raise entry.error(NAME, shown(key))
    return inside


def table(at: Value) -> dict[str, Any]:
    """A table."""
    if not isinstance(at.value, dict):
        raise at.error("a table")
    return at.value


def text(at: Value, expected: str = "a text") -> str:
    """A text that is not empty."""
    if not isinstance(at.value, str) or not at.value.strip():
        raise at.error(expected)
    return at.value


def name(at: Value) -> str:
    """A name that can be part of a file's."""
    if not is_name(at.value):
        raise at.error(NAME)
    return str(at.value)


def is_name(value: object) -> bool:
    """Whether a value can be a name."""
    return isinstance(value, str) and re.fullmatch(r"[\w.-]+", value) is not None


def one_of(at: Value, choices: Iterable[str]) -> str:
    """One of the words that are known."""
    known = list(choices)
    if isinstance(at.value, str) and at.value not in known:
        raise at.error(listed(known), shown(at.value) + suggestion(at.value, known))
    if not isinstance(at.value, str):
        raise at.error(listed(known))
    return at.value


def number(at: Value, *, above: float = -math.inf, least: float = -math.inf, most: float = math.inf) -> float:
    """A finite number within limits."""
    limits = [
        f"{word} {limit:g}"
        for word, limit in (("above", above), ("of at least", least), ("at most", most))
        if math.isfinite(limit)
    ]
    expected = f"a number {' and '.join(limits)}".strip()
    value = at.value
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 2**63:
        raise at.error(expected)
    if value <= above or value < least or value > most:
        raise at.error(expected)
    return float(value)


def whole(at: Value, *, least: int | None = None) -> int:
    """A whole number within limits."""
    expected = "a whole number" if least is None else f"a whole number of at least {least}"
    value = at.value
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**63:
        raise at.error(expected)
    if least is not None and value < least:
        raise at.error(expected)
    return value


def triple(at: Value, *, above: float = -math.inf) -> tuple[float, float, float]:
    """Three numbers."""
    if not isinstance(at.value, list) or len(at.value) != 3:
        raise at.error("three numbers")
    x, y, z = (number(at.at(i, value), above=above) for i, value in enumerate(at.value))
    return x, y, z


def span(at: Value) -> range:
    """Frames from a first to a last one, both included in the file."""
    expected = "[first, last], whole numbers, first <= last"
    if not isinstance(at.value, list) or len(at.value) != 2:
        raise at.error(expected)
    if any(isinstance(v, bool) or not isinstance(v, int) or abs(v) >= 2**62 for v in at.value):
        raise at.error(expected)
    first, last = at.value
    if first > last:
        raise at.error(expected)
    return range(first, last + 1)


def texts(at: Value, what: str) -> tuple[str, ...]:
    """A list of at least one text."""
    if not isinstance(at.value, list) or not at.value:
        raise at.error(f"a list of {what}")
    return tuple(text(at.at(i, value), expected=f"one of the {what}") for i, value in enumerate(at.value))


def file_path(at: Value, expected: str, *, folder_too: bool = False) -> FilePath:
    """A file that exists.

    Args:
        at: its path, relative to the scene file.
        expected: what it should be, for the error.
        folder_too: a folder will do.

    Raises:
        SceneError: no text, or nothing there.
    """
    written = text(at, expected)
    joined = os.path.join(at.file.absolute().parent, written)
    if not os.path.exists(joined):
        raise at.error(expected, f"nothing at {joined if joined.isprintable() else shown(joined)}")
    if not folder_too and not os.path.isfile(joined):
        raise at.error(expected, f"a folder at {joined}")
    return FilePath(written, Path(joined).resolve())
