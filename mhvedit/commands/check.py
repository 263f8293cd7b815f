"""`mhvedit check`."""

import json
from typing import Annotated

import typer

from mhvedit.commands.shared import DONE, NO, Json, Solved, Workers, progress_bar
from mhvedit.errors import counted


def check(
    out: Solved,
    penetration: Annotated[float, typer.Option(help="How deep anybody may be in anybody, mm.")] = 60.0,
    skate: Annotated[float, typer.Option(help="Speed that the edit may add to soles on the floor, m/s.")] = 0.5,
    step: Annotated[float, typer.Option(help="What the edit may add from frame to frame, mm.")] = 50.0,
    turn: Annotated[float, typer.Option(help="What the edit may turn from frame to frame, degrees.")] = 10.0,
    jump: Annotated[float, typer.Option(help="Change of the added velocity from frame to frame, m/s.")] = 1.0,
    types: Annotated[bool, typer.Option(help="Whether segments must do what their type asks.")] = True,
    sight: Annotated[bool, typer.Option(help="Whether people must see each other where asked.")] = True,
    between: Annotated[int, typer.Option(min=0, help="Sub-steps between frames to look at.")] = 0,
    workers: Workers = 2,
    json_: Json = False,
) -> None:
    """Check the edited scene on the meshes themselves, every frame of it."""
    from mhvedit.pipeline.folders import NoAnswer
    from mhvedit.pipeline.run import check_output
    from mhvedit.scene.report import Thresholds, report_as_dict

    limits = Thresholds(penetration, skate, step, turn, jump, types, sight)
    try:
        with progress_bar(quiet=json_) as progress:
            report, problems = check_output(
                out, thresholds=limits, between_frames=between, workers=workers, progress=progress
            )
    except NoAnswer as fault:
        print(json.dumps({"frames": 0, "problems": [str(fault)]}, indent=1) if json_ else fault)
        raise typer.Exit(NO) from None
    if json_:
        print(json.dumps(report_as_dict(report) | {"problems": list(problems)}, indent=1))
    else:
        print(f"{counted(report.n_frames, 'frame')}, deepest penetration {report.deepest * 1000:.1f} mm")
        for sentence in problems:
            print(sentence)
        if not problems:
            print("nothing passes a threshold")
    raise typer.Exit(NO if problems else DONE)
