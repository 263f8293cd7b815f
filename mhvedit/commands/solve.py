"""`mhvedit solve` and `mhvedit demo`."""

import gc
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mhvedit.commands.shared import DONE, NO, Json, Out, Workers, progress_bar, say
from mhvedit.commands.starting import start_lean
from mhvedit.errors import counted

if TYPE_CHECKING:
    from mhvedit.pipeline.run import Outcome


def demo(out: Out = Path("out/demo"), workers: Workers = 2, json_: Json = False) -> None:
    """Solve a cut of the bundled sword fight and say where to look."""
    from mhvedit.pipeline.bundled import bundled_scene

    _run(bundled_scene("demo"), out, workers, json_)


def solve(
    scene: Annotated[Path, typer.Argument(help="Scene file (.toml).")],
    out: Out,
    workers: Workers = 2,
    report: Annotated[bool, typer.Option(help="Draw the HTML report.")] = True,
    answer_only: Annotated[bool, typer.Option("--answer-only", help="Stop before the check on the meshes.")] = False,
    cache: Annotated[float | None, typer.Option(min=0, help="GB that the cache may take; 8 if not given.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, to search there.")] = None,
    json_: Json = False,
) -> None:
    """Find every placement, choose the best chain, write the edit; then check it on the meshes and draw the report."""
    if scheduler is not None:
        from mhvedit.batch.run import solve_segments

        solve_segments(scene, out, scheduler=scheduler)
    _run(scene, out, workers, json_, check=not answer_only, report=report, cache=cache)


def _run(
    scene: Path,
    out: Path,
    workers: int,
    json_: bool,
    *,
    check: bool = True,
    report: bool = True,
    cache: float | None = None,
) -> None:
    """Solve, saying what comes of it as soon as it is known, and leave with the right exit code."""
    start_lean()
    if workers > 1:
        from mhvedit.commands.ahead import compile_ahead

        compile_ahead()
    from mhvedit.pipeline.run import run_scene

    gc.freeze()  # what has been imported stays: it need not be gone through again and again
    with progress_bar(quiet=json_) as progress:
        outcome = run_scene(
            scene,
            out,
            workers=workers,
            check=check,
            report=report,
            cache_gb=cache,
            progress=progress,
            warn=lambda text: say(f"warning: {text}"),
            answered=None if json_ else _print_answer,
        )
    if json_:
        print(json.dumps(outcome.report, indent=1))
    else:
        _print_check(outcome, out)
    raise typer.Exit(NO if outcome.result.assembly is None else DONE)


def _print_answer(outcome: "Outcome") -> None:
    for segment in outcome.result.segments:
        print(
            f"{segment.spec.name}  {segment.spec.interaction.value}  {_count(segment.n_solutions, segment.n_regions)}"
        )
        miss = outcome.result.misses.get(segment.spec.name)
        if miss is not None:
            print(f"  nothing fits: {miss.killed_by} ({miss.poses:,} poses got that far); {miss.nearest}")
    assembly = outcome.result.assembly
    if assembly is None:
        print(f"no answer: {outcome.result.failure}")
    else:
        cost = f"cost {assembly.scene.cost:.3g} m² (gap {assembly.scene.gap:.2g} %)"
        print(f"{counted(assembly.scene.n_frames, 'frame')}, {cost}", flush=True)
        for stop in outcome.report.get("stops", ()):
            print(stop["sentence"], flush=True)


def _count(solutions: int, regions: int) -> str:
    if solutions == 0:
        return "no placement"
    placements = "1 placement" if solutions == 1 else f"{solutions:,} placements"
    return f"{placements} in {'1 region' if regions == 1 else f'{regions:,} regions'}"


def _print_check(outcome: "Outcome", out: Path) -> None:
    if outcome.report["check"] is not None:
        print(f"deepest penetration {outcome.report['check']['deepest_mm']:.1f} mm")
        for sentence in outcome.report["problems"]:
            print(f"look at: {sentence}")
    elif outcome.report["unchecked"]:
        print(outcome.report["unchecked"].replace("`mhvedit check`", f"`mhvedit check {out}`"))
    page = out / "report.html"
    print(f"open {page}" if page.exists() else f"written to {out}")
