"""`mhvedit avoid`."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mhvedit.commands.shared import DONE, NO, Json, Out, Workers, progress_bar, say
from mhvedit.errors import counted

if TYPE_CHECKING:
    from mhvedit.pipeline.avoid import AvoidOutcome


def avoid(
    motion: Annotated[Path, typer.Argument(help="Skinned .npz, or .bvh.")],
    out: Out,
    body: Annotated[
        Path | None, typer.Option(help="Skinned .npz whose body a .bvh is put on; capsules if not given.")
    ] = None,
    attach: Annotated[list[str] | None, typer.Option(help="MESH:LIMB, equipment that hangs on a limb.")] = None,
    freeze: Annotated[list[str] | None, typer.Option(help="A joint that must not move.")] = None,
    method: Annotated[str, typer.Option(help="bisection, filter or nebel.")] = "bisection",
    units: Annotated[str, typer.Option(help="Of a .bvh: m, cm or mm.")] = "m",
    up: Annotated[str, typer.Option(help="Axis of a .bvh that points up: x, y or z.")] = "z",
    continuous: Annotated[bool, typer.Option(help="Look between the frames too.")] = True,
    workers: Workers = 2,
    report: Annotated[bool, typer.Option(help="Draw the HTML report.")] = True,
    json_: Json = False,
) -> None:
    """Remove self-collision from a motion: a collision-free motion and a report."""
    from mhvedit.pipeline.avoid import AvoidOptions, method_of, run_avoid

    options = AvoidOptions(
        method=method_of(method),
        body=body,
        attached=tuple(attach or ()),
        frozen=tuple(freeze or ()),
        units=units,
        up=up,
        continuous=continuous,
        report=report,
        workers=workers,
    )
    warned = list[str]()

    def warn(sentence: str) -> None:
        warned.append(sentence)
        say(f"warning: {sentence}")

    with progress_bar(quiet=json_) as progress:
        outcome = run_avoid(motion, out, options=options, progress=progress, warn=warn)
    if json_:
        print(_as_json(outcome.report))
    else:
        _print_outcome(outcome, out, warned)
    raise typer.Exit(DONE if outcome.found.avoided.converged else NO)


def _as_json(report: Mapping[str, Any]) -> str:
    """A line for each entry: some have a number for each frame."""
    return "{\n" + ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in report.items()) + "\n}"


def _print_outcome(outcome: "AvoidOutcome", out: Path, warned: list[str]) -> None:
    m = outcome.found.metrics
    print(
        f"{counted(m.frames, 'frame')}, colliding {m.colliding_before} before and {m.colliding_after} after; "
        f"{m.touched} touched, jerk x {m.jerk_ratio:.2f}, feet that stood still moved {m.slip_mm:.1f} mm"
    )
    for sentence in outcome.found.why:
        print(f"did not converge: {sentence}")
    for sentence in outcome.found.notes:
        if sentence not in warned:
            print(f"note: {sentence}")
    page = out / "report.html"
    print(f"open {page}" if page.exists() else f"written to {out}")
