"""`mhvedit inspect`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from mhvedit.commands.shared import Json


def inspect(
    path: Annotated[Path, typer.Argument(help="Folder of numbered meshes, .npz or USD file.")],
    fps: Annotated[float | None, typer.Option(min=0.001, help="Frames a second, if known.")] = None,
    units: Annotated[str | None, typer.Option(help="m, cm or mm; guessed if not given.")] = None,
    up: Annotated[str | None, typer.Option(help="x, y or z; guessed if not given.")] = None,
    json_: Json = False,
) -> None:
    """Say what a capture is: frames, gaps, size, units, up axis, holes, textures."""
    from mhvedit.sequences.axes import check_axes
    from mhvedit.sequences.inspect import as_dict, as_text, inspect_capture

    check_axes(units or "m", up or "z")
    summary = inspect_capture(path, fps=fps, units=units, up=up)
    print(json.dumps(as_dict(summary), indent=1) if json_ else as_text(summary))
