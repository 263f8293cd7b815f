"""`mhvedit export`."""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mhvedit.commands.shared import Json, Solved, progress_bar, say

if TYPE_CHECKING:
    from mhvedit.export.content import Exported


def export(
    out: Solved,
    to: Annotated[Path, typer.Option(help="A .usd .usda .usdc .usdz .glb or .mp4 file, or a folder of meshes.")],
    flatten: Annotated[bool, typer.Option("--flatten", help="USD: all meshes in one file, no references.")] = False,
    assets: Annotated[Path | None, typer.Option(help="USD: folder for USD copies of the captures.")] = None,
    draco: Annotated[bool, typer.Option("--draco", help="GLB: compress the meshes, to about 0.1 mm.")] = False,
    format_: Annotated[str | None, typer.Option("--format", help="Folder: obj (default) or ply.")] = None,
    up: Annotated[str | None, typer.Option(help="USD, folder: z (default) or y.")] = None,
    camera: Annotated[str | None, typer.Option(help="Movie: fixed (default), orbit, or whose eyes.")] = None,
    size: Annotated[str | None, typer.Option(help="Movie: WIDTHxHEIGHT in pixels; 1280x720.")] = None,
    fps: Annotated[float | None, typer.Option(min=0.001, help="Movie: frames a second; the scene's.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over an earlier file or export.")] = False,
    json_: Json = False,
) -> None:
    """Take the edited scene to Blender, Houdini, Unreal, a browser, or a movie."""
    from mhvedit.export.folder import MeshFormat
    from mhvedit.pipeline.export import ExportSettings, export_output

    settings = ExportSettings(
        flatten=flatten,
        assets=assets,
        draco=draco,
        files=None if format_ is None else MeshFormat(_one_of("--format", format_, list(MeshFormat))),
        up=None if up is None else _one_of("--up", up, ["y", "z"]),
        camera=camera,
        size=None if size is None else _pixels(size),
        fps=fps,
    )
    with progress_bar(quiet=json_) as progress:
        made = export_output(out, to, settings, force=force, progress=progress)
    _tell(made, json_)


def _one_of(option: str, given: str, known: list[str]) -> str:
    if given not in known:
        raise typer.BadParameter(f"{option}: expected {' or '.join(known)}, found {given!r}")
    return given


def _pixels(given: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", given)
    if found is None:
        raise typer.BadParameter(f"--size: expected WIDTHxHEIGHT like 1280x720, found {given!r}")
    return int(found[1]), int(found[2])


def _tell(made: "Exported", json_: bool) -> None:
    for sentence in made.warnings:
        say(f"warning: {sentence}")
    if json_:
        kept = [str(path) for path in made.kept]
        told = {"written": str(made.written), "kept": kept, "warnings": list(made.warnings), "offset": made.offset}
        print(json.dumps(told, indent=1))
    else:
        print(f"written to {made.written}")
