"""The USD library, which is an extra, and what every stage that is written here says about itself."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from mhvedit.errors import MissingLibrary
from mhvedit.export.target import ExportError

TURNED_Y_UP: Final = ((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1))  # rows multiply: (x, y, z) -> (x, z, -y)


def pxr() -> Any:  # noqa: ANN401 - modules of an untyped library
    """The USD library.

    Raises:
        MissingLibrary: it is not installed.
    """
    try:
        import pxr
        from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt  # noqa: F401 - so that pxr has them
    except ImportError as error:
        raise MissingLibrary("writing USD", "pip install 'mhvedit[usd]'") from error
    return pxr


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say it in one sentence when USD cannot write, for example because the disk is full.

    Raises:
        ExportError: what USD says.
    """
    try:
        yield
    except pxr().Tf.ErrorException as error:
        raise ExportError(path, "a stage that USD can write", " ".join(str(error).split())[:200]) from error


def describe_stage(layer: Any, *, root: str, fps: float, start: int, end: int, up: str) -> None:  # noqa: ANN401
    """Write what a reader has to know of a layer: metres, up axis, rate, first and last frame, default prim."""
    layer.defaultPrim = root
    layer.timeCodesPerSecond = layer.framesPerSecond = fps
    layer.startTimeCode, layer.endTimeCode = start, end
    layer.pseudoRoot.SetInfo("metersPerUnit", 1.0)
    layer.pseudoRoot.SetInfo("upAxis", up.upper())


def identifier(name: str, taken: set[str]) -> str:
    """A name of a prim: letters, digits and _ alone, none twice; `taken` learns it."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    plain = plain if plain[:1].isalpha() or plain[:1] == "_" else f"_{plain}"
    found, count = plain, 2
    while found in taken:
        found, count = f"{plain}_{count}", count + 1
    taken.add(found)
    return found
