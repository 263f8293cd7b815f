"""`mhvedit cache`."""

import json
from dataclasses import asdict

import typer

from mhvedit.commands.shared import Json, Solved, help_if_alone

cache = typer.Typer(help="Show or clear what an output folder keeps between runs.")
cache.callback(invoke_without_command=True)(help_if_alone)


@cache.command()
def show(out: Solved, json_: Json = False) -> None:
    """Show how much is kept of each stage, and how long ago it was used."""
    from mhvedit.pipeline.kept import GB, cache_limit, entries_in, summaries
    from mhvedit.pipeline.output import require_output

    require_output(out)
    stages = summaries(entries_in(out))
    total = sum(stage.size for stage in stages)
    if json_:
        print(json.dumps({"size": total, "limit": cache_limit() * GB, "stages": [asdict(s) for s in stages]}, indent=1))
        return
    for stage in stages:
        ages = f"{_age(stage.newest)} to {_age(stage.oldest)} ago"
        print(f"{stage.stage:<10}{stage.entries:>7,} files  {_size(stage.size):>9}  last used {ages}")
    print(f"{_size(total)} of at most {cache_limit():g} GB")


@cache.command()
def clear(out: Solved) -> None:
    """Take away all that is kept; the next run makes it again."""
    from mhvedit.pipeline.kept import clear as clear_cache
    from mhvedit.pipeline.output import claimed, require_output

    require_output(out)
    with claimed(out):
        print(f"{_size(clear_cache(out))} freed")


def _size(count: int) -> str:
    return f"{count / 1e9:.2f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"


def _age(seconds: float) -> str:
    for unit, length in (("days", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(0.0, seconds):.0f} s"
