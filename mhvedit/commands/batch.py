"""`mhvedit batch`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mhvedit.commands.shared import BAD_INPUT, DONE, NO, Json, Out, progress_bar, say

if TYPE_CHECKING:
    from mhvedit.batch.tasks import SceneDone


def batch(
    scenes: Annotated[list[Path], typer.Argument(help="Scene files, templates, and folders of both (.toml).")],
    out: Out,
    workers: Annotated[int, typer.Option(min=1, help="Processes of one thread; the scenes do not depend on it.")] = 2,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler; else one is started.")] = None,
    memory: Annotated[float | None, typer.Option(min=0.1, help="GB for each worker; else an equal share.")] = None,
    solutions: Annotated[int, typer.Option(min=1, help="Of each scene file, unlike each other.")] = 1,
    report: Annotated[bool, typer.Option(help="Draw an HTML report of each scene.")] = True,
    answer_only: Annotated[bool, typer.Option("--answer-only", help="Stop before the check on the meshes.")] = False,
    cache: Annotated[float | None, typer.Option(min=0, help="GB that the cache may take; 8 if not given.")] = None,
    json_: Json = False,
) -> None:
    """Solve many scenes; what an earlier run finished is left as it is, and one bad scene fails alone."""
    from mhvedit.batch import tasks
    from mhvedit.batch.asked import asked_scenes
    from mhvedit.batch.report import INDEX, in_words, summary
    from mhvedit.batch.run import Options, run_batch

    asked = asked_scenes(scenes, out, solutions=solutions)
    options = Options(
        workers=workers,
        scheduler=scheduler,
        memory=memory,
        cache=cache,
        check=not answer_only,
        report=report,
    )
    with progress_bar(quiet=json_) as tell:

        def told(done: "SceneDone", finished: int, known: int) -> None:
            if tell is not None:
                tell("scenes", finished / known)
            if not json_:
                print(in_words(done), flush=True)

        def watch(place: str) -> None:
            if tell is not None:
                say(f"dashboard: {place}")

        found = run_batch(asked, out, options=options, told=told, watch=watch)
    if json_:
        print(json.dumps(summary(found), indent=1))
    else:
        print(f"open {out / INDEX}")
    verdicts = {done.verdict for done in found}
    for done in found:
        if done.verdict == tasks.BAD:
            say(f"mhvedit: {done.sentences[0]}")
    raise typer.Exit(BAD_INPUT if tasks.BAD in verdicts else NO if tasks.NO in verdicts else DONE)
