"""What came of a batch: `summary.json` for programs, `index.html` for people."""

from collections.abc import Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any, Final

from mhvedit.batch.tasks import BAD, DONE, NO, SceneDone
from mhvedit.errors import counted
from mhvedit.files import replacing
from mhvedit.pipeline.folders import PAGE
from mhvedit.pipeline.output import write_json

SUMMARY, INDEX = "summary.json", "index.html"
HEADER: Final = ("scene", "verdict", "frames", "cost m²", "deepest mm", "seconds", "")
STYLE: Final = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; color: #222; }
table { border-collapse: collapse; width: 100%; }
th, td { padding: .3em .7em; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top; }
td:nth-child(n+3):nth-child(-n+6) { text-align: right; font-variant-numeric: tabular-nums; }
.done { color: #1a6b3c; } .no { color: #8a5a00; } .bad, .missing { color: #a8201a; }
"""
CLASSES: Final = {DONE: "done", NO: "no", BAD: "bad"}


def write_summary(out: Path, scenes: Sequence[SceneDone], *, missing: Sequence[str]) -> None:
    """Write both.

    Args:
        out: output folder of the batch.
        scenes: what came of those that are finished, in order.
        missing: names of the others.
    """
    write_json(out / SUMMARY, summary(scenes, missing=missing))
    with replacing(out / INDEX) as beside:
        beside.write_text(_page(out, scenes, missing), encoding="utf-8")


def summary(scenes: Sequence[SceneDone], *, missing: Sequence[str] = ()) -> dict[str, Any]:
    """The content of `summary.json`.

    Args:
        scenes: what came of those that are finished, in order.
        missing: names of the others.
    """
    count = {verdict: sum(scene.verdict == verdict for scene in scenes) for verdict in (DONE, NO, BAD)}
    entries = [{key: value for key, value in asdict(scene).items() if key != "files"} for scene in scenes]
    return {"count": count, "missing": list(missing), "scenes": entries}


def in_words(scene: SceneDone) -> str:
    """A line on a scene.

    >>> in_words(SceneDone("raise", DONE, frames=16, cost=0.25, seconds=3.14))
    'raise  done  16 frames, cost 0.25 m²  3.1 s'
    """
    parts = [scene.name, scene.verdict]
    if scene.verdict == DONE:
        deepest = "" if scene.deepest_mm is None else f", deepest penetration {scene.deepest_mm:.1f} mm"
        parts.append(f"{counted(scene.frames, 'frame')}, cost {scene.cost:.3g} m²{deepest}")
    else:
        parts.append(scene.sentences[0])
    return "  ".join([*parts, *([f"{scene.seconds:.1f} s"] if scene.seconds else [])])


def _page(out: Path, scenes: Sequence[SceneDone], missing: Sequence[str]) -> str:
    rows = [_row(out, scene) for scene in scenes]
    rows += [f'<tr><td>{escape(name)}</td><td class="missing">not finished</td></tr>' for name in missing]
    counted = summary(scenes)["count"]
    said = ", ".join(f"{number} {verdict}" for verdict, number in counted.items() if number)
    head = "".join(f"<th>{word}</th>" for word in HEADER)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Scenes</title><style>{STYLE}</style>'
        f"<h1>{len(scenes) + len(missing)} scenes</h1><p>{said or 'none finished'}"
        f"{f', {len(missing)} not finished' if missing else ''}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></html>\n"
    )


def _row(out: Path, scene: SceneDone) -> str:
    name = escape(scene.name)
    linked = f'<a href="{name}/{PAGE}">{name}</a>' if (out / scene.name / PAGE).exists() else name
    said = "<br>".join(escape(sentence) for sentence in scene.sentences)
    numbers = (
        str(scene.frames) if scene.frames else "",
        "" if scene.cost is None else f"{scene.cost:.3g}",
        "" if scene.deepest_mm is None else f"{scene.deepest_mm:.1f}",
        f"{scene.seconds:.1f}" if scene.seconds else "",
    )
    cells = "".join(f"<td>{number}</td>" for number in numbers)
    verdict = f'<td class="{CLASSES[scene.verdict]}">{scene.verdict}</td>'
    return f"<tr><td>{linked}</td>{verdict}{cells}<td>{said}</td></tr>"
