"""Scene files for further solutions of a scene, each of which pins another one."""

import tomllib
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from mhvedit.batch.diverse import diverse_rows
from mhvedit.batch.template import moved_content
from mhvedit.geometry.arrays import IntArray
from mhvedit.geometry.planar import compose, invert, wrap_angle
from mhvedit.pipeline.assemble import by_pair, shared_rows
from mhvedit.pipeline.job import Job, Result, mirrored_spot, solve
from mhvedit.pipeline.picks import canonical_frames, rows_left
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.project.scene_file import load_scene, read_text
from mhvedit.project.schema import Spot


def variant_scenes(job: Job, chosen: Mapping[str, int], *, name: str, count: int, out: Path) -> dict[str, str]:
    """Scene files for the second and further solutions of a scene, by name.

    They differ in one segment, the one whose solutions lie in most regions, and the chain chooses the others anew.

    Args:
        job: loaded; its segments are solved, and kept.
        chosen: row of the solution group by segment, as the best answer has it.
        name: of the scene.
        count: how many solutions there are to be, the best answer among them.
        out: output folder of the batch.
    """
    result = solve(job, workers=1)
    able = [(segment, rows_that_go(result, segment)) for segment in result.segments if segment.spec.pin is None]
    if not able:
        return {}
    pivot, left = max(able, key=lambda entry: (len(np.unique(entry[0].group.region[entry[1]])), len(entry[1])))
    rows = diverse_rows(pivot, chosen[pivot.name], count, left=left)[1:]
    content = tomllib.loads(read_text(job.scene.file))
    made = {}
    for i, row in enumerate(rows):
        own = f"{name}-v{i + 2}"
        moved = moved_content(content, job.scene.file.absolute().parent, out / own)
        made[own] = tomlkit.dumps(_pinned(moved, pivot.name, _spot(result, pivot, row), own))
    return made


def rows_that_go(result: Result, segment: SolvedSegment) -> IntArray:
    """(N,) solutions that the editor leaves, and that the segments which adjoin this one have too.

    Args:
        result: of a solve that has an answer.
        segment: one of its segments.
    """
    assert result.assembly is not None
    spans, segments = result.assembly.line.spans, result.segments
    own = next(own for own in by_pair(segments) if any(segments[i] is segment for i in own))
    breaks = [0, *(n + 1 for n, (i, j) in enumerate(pairwise(own)) if spans[i].stop != spans[j].start), len(own)]
    runs = (own[start:stop] for start, stop in pairwise(breaks))
    run = [segments[i] for i in next(run for run in runs if any(segments[i] is segment for i in run))]
    shared = shared_rows(run, [rows_left(each.spec, each, result.people) for each in run])
    return shared[run.index(segment)] if shared is not None else np.zeros(0, np.int64)


def _spot(result: Result, segment: SolvedSegment, row: int) -> Spot:
    """A solution as the scene file tells it."""
    a, b = canonical_frames(segment, result.people)
    pose = compose(compose(a, segment.rows(np.array([row])).poses[0]), invert(b))
    spot = Spot(*pose.tolist())
    told = load_scene(result.job.scene.file).segments[segment.spec.index]
    return spot if told.between == segment.spec.between else mirrored_spot(spot)


def _pinned(content: Mapping[str, Any], segment: str, spot: Spot, name: str) -> dict[str, Any]:
    pin = {"x": round(spot.x, 6), "y": round(spot.y, 6), "yaw": round(degrees(float(wrap_angle(spot.yaw))), 6)}
    entries: Sequence[Mapping[str, Any]] = content["segments"]
    segments = [{**entry, "pin": pin} if entry["name"] == segment else entry for entry in entries]
    return {**content, "name": name, "segments": segments}
