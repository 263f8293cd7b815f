"""The command line: thin over `mhvedit.pipeline.run`. A command imports what is slow to import when it runs."""

import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mhvedit import __version__
from mhvedit.errors import MhveditError

if TYPE_CHECKING:
    from mhvedit.pipeline.job import Progress
    from mhvedit.pipeline.run import Outcome

DONE, NO, BAD_INPUT = 0, 1, 2
INTERRUPTED = 130
STOPPED = "interrupted; the next run goes on from here"

app = typer.Typer(
    help="Put people who were filmed apart into one scene.", no_args_is_help=True, pretty_exceptions_enable=False
)
Json = Annotated[bool, typer.Option("--json", help="Print a machine-readable result.")]
Workers = Annotated[int, typer.Option(min=1, help="Threads; the result does not depend on it.")]
Out = Annotated[Path, typer.Option("-o", "--out", help="Output folder.")]


def main() -> None:
    """Run the command line; bad input becomes one line on stderr and exit code 2."""
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    sys.exit(_exit_code())


def _exit_code() -> int:
    """Run the command that was asked for; typer returns the code of an exit, and makes one of Ctrl-C."""
    try:
        code = int(app(standalone_mode=False) or DONE)
        return _complain(STOPPED, INTERRUPTED) if code == INTERRUPTED else code
    except MhveditError as fault:
        return _complain(str(fault), BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return _complain(STOPPED, INTERRUPTED)
    except OSError as fault:
        expected = "a file or folder that can be read and written"
        return _complain(
            f"{fault.filename or 'output'}: expected {expected}, found: {fault.strerror or fault}", BAD_INPUT
        )
    except MemoryError:
        return _complain(
            "expected a search that fits in memory: enlarge search.voxel, or reduce search.window", BAD_INPUT
        )
    except Exception as fault:
        if hasattr(fault, "format_message"):  # a usage error of the command line itself
            return _complain(fault.format_message(), BAD_INPUT)
        raise


def _complain(sentence: str, code: int) -> int:
    if sentence:  # none where click has shown its help instead
        print(f"mhvedit: {' '.join(sentence.splitlines())}", file=sys.stderr)
    return code


@app.command()
def demo(out: Out = Path("out/demo"), workers: Workers = 2, json_: Json = False) -> None:
    """Solve a cut of the bundled sword fight and say where to look."""
    from mhvedit.pipeline.bundled import bundled_scene

    _finish(_run(bundled_scene("demo"), out, workers, quiet=json_), out, json_)


@app.command()
def solve(
    scene: Annotated[Path, typer.Argument(help="Scene file (.toml).")],
    out: Out,
    workers: Workers = 2,
    report: Annotated[bool, typer.Option(help="Draw the HTML report.")] = True,
    json_: Json = False,
) -> None:
    """Find every placement, choose the best chain, write the edited scene and its report."""
    _finish(_run(scene, out, workers, quiet=json_, report=report), out, json_)


@app.command()
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


@app.command()
def check(
    out: Annotated[Path, typer.Argument(help="Output folder of `mhvedit solve`.")],
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
    from mhvedit.pipeline.run import check_output
    from mhvedit.scene.report import Thresholds, report_as_dict

    limits = Thresholds(penetration, skate, step, turn, jump, types, sight)
    with _progress(quiet=json_) as progress:
        report, problems = check_output(
            out, thresholds=limits, between_frames=between, workers=workers, progress=progress
        )
    if json_:
        print(json.dumps(report_as_dict(report) | {"problems": list(problems)}, indent=1))
    else:
        print(f"{report.n_frames} frames, deepest penetration {report.deepest * 1000:.1f} mm")
        for sentence in problems:
            print(sentence)
        if not problems:
            print("nothing passes a threshold")
    raise typer.Exit(NO if problems else DONE)


@app.command()
def version() -> None:
    """Print the version."""
    print(__version__)


def _run(scene: Path, out: Path, workers: int, *, quiet: bool, report: bool = True) -> "Outcome":
    from mhvedit.pipeline.run import run_scene

    with _progress(quiet=quiet) as progress:
        return run_scene(
            scene, out, workers=workers, report=report, progress=progress, warn=lambda text: _say(f"warning: {text}")
        )


def _finish(outcome: "Outcome", out: Path, json_: bool) -> None:
    """Say what came of it, and leave with the right exit code."""
    if json_:
        print(json.dumps(outcome.report, indent=1))
    else:
        _print_outcome(outcome, out)
    raise typer.Exit(NO if outcome.result.assembly is None else DONE)


def _print_outcome(outcome: "Outcome", out: Path) -> None:
    for segment in outcome.result.segments:
        regions = int(segment.group.region.max(initial=-1)) + 1
        found = f"{len(segment.group):,} placements in {regions} regions"
        print(f"{segment.spec.name}  {segment.spec.interaction.value}  {found}")
        miss = outcome.result.misses.get(segment.spec.name)
        if miss is not None:
            print(f"  nothing fits: {miss.killed_by} ({miss.poses:,} poses got that far); {miss.nearest}")
    assembly = outcome.result.assembly
    if assembly is None:
        print(f"no answer: {outcome.result.failure}")
    else:
        deepest = outcome.report["check"]["deepest_mm"]
        print(
            f"{assembly.scene.n_frames} frames, cost {assembly.scene.cost:.3g} m² (gap {assembly.scene.gap:.2g} %), "
            f"deepest penetration {deepest:.1f} mm"
        )
        for sentence in outcome.report["problems"]:
            print(f"look at: {sentence}")
    page = out / "report.html"
    print(f"open {page}" if page.exists() else f"written to {out}")


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr)


@contextmanager
def _progress(*, quiet: bool) -> "Iterator[Progress | None]":
    """A progress bar on a terminal; nothing where the output goes elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        tasks = {}

        def tell(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=share)

        yield tell


if __name__ == "__main__":
    main()
