"""What commands have in common: exit codes, options, words to stderr, a progress bar."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from mhvedit.pipeline.progress import Progress

DONE, NO, BAD_INPUT = 0, 1, 2
INTERRUPTED = 130

Json = Annotated[bool, typer.Option("--json", help="Print a machine-readable result.")]
Workers = Annotated[int, typer.Option(min=1, help="Threads; the result does not depend on it.")]
Out = Annotated[Path, typer.Option("-o", "--out", help="Output folder.")]
Solved = Annotated[Path, typer.Argument(help="Output folder of `mhvedit solve`.")]


def help_if_alone(context: typer.Context) -> None:
    """Show the help of a command that stands without one of its own commands."""
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(BAD_INPUT)


def say(sentence: str) -> None:
    """Tell a person something that is not the result."""
    print(sentence, file=sys.stderr)


@contextmanager
def progress_bar(*, quiet: bool) -> "Iterator[Progress | None]":
    """A progress bar on a terminal; nothing where the output goes elsewhere.

    Args:
        quiet: nothing on a terminal either.
    """
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
