"""Paths between key segments that keep clear of the others and of props: where they do not, they give way.

What is looked for is measured on the meshes: in which frames two bodies are deeper in each other than their segments on
either side allow, or at all where they have nothing to do with each other, while one of them is between key segments.
For each run of such frames one direction is chosen, in which they part soonest. Then the paths are bent along it (see
`optimise.bending`) until nobody is too deep, or nothing more is gained.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.bending import Push, bent
from mhvedit.optimise.transitions import shift_weights
from mhvedit.pipeline.assemble import Assembly, Bend, path_settings
from mhvedit.pipeline.bodies import Body
from mhvedit.pipeline.depths import Movers, Pair, depths_at_first, depths_of, movers_of, solid_mesh
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile
from mhvedit.scene.edit import SubjectEdit
from mhvedit.scene.sinking import sunk
from mhvedit.sequences.meshes import Mesh

SPARE: Final = 0.002  # m more than what is needed
GAP: Final = 4  # frames between runs that are one
ROUNDS: Final = 8
DIRECTIONS: Final = 8
FURTHEST: Final = 0.5  # m; two of whom one would have to be shifted further are left as they are


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """Frames in which two are too deep in each other."""

    pair: Pair
    frames: IntArray  # (K,)
    depth: FloatArray  # (K,) m, at first
    direction: FloatArray  # (2,) unit, in which the first is moved


def kept_clear(
    scene: SceneFile,
    assembly: Assembly,
    *,
    people: Mapping[str, Person],
    props: Mapping[str, Prop],
    bodies: Mapping[str, Body],
    store: Store,
    workers: int,
) -> Assembly:
    """The scene with paths that give way; untouched where nobody is too deep in anybody.

    Args:
        scene: the scene file.
        assembly: with everybody on the stage.
        people: by name.
        props: those that are fixed.
        bodies: of people and of these props, by name.
        store: where depths are kept between runs.
        workers: threads; the result does not depend on it.
    """
    movers = movers_of(scene, assembly.scene, people, props=props, bodies=bodies, workers=workers)
    depths = depths_at_first(movers, store)
    runs = [run for pair, depth in depths.items() for run in _runs(movers, pair, depth)]
    if not runs:
        return assembly
    shifts, costs, after = _bent(movers, runs, depths)
    subjects = {
        name: SubjectEdit(own.source, movers.paths(shifts)[name]) for name, own in assembly.scene.subjects.items()
    }
    bends = tuple(_bend(movers, run, after, shifts, costs) for run in runs)
    return replace(assembly, scene=replace(assembly.scene, subjects=subjects), bends=bends)


def _excess(movers: Movers, depths: Mapping[Pair, FloatArray]) -> float:
    """How much too deep anybody is, summed over frames, m."""
    return float(sum(np.maximum(depth - movers.allowed[pair], 0.0).sum() for pair, depth in depths.items()))


def _runs(movers: Movers, pair: Pair, depth: FloatArray) -> list[_Run]:
    """Runs of frames in which two are too deep in each other."""
    deep = np.flatnonzero(depth > movers.allowed[pair])
    if not len(deep):
        return []
    parts = np.split(deep, np.flatnonzero(np.diff(deep) > GAP) + 1)
    found = []
    for own in parts:
        telling = np.array([own[0], own[depth[own].argmax()], own[-1]])
        found.append(_Run(pair, own, depth[own], _way_out(movers, pair, telling)))
    return found


def _way_out(movers: Movers, pair: Pair, frames: IntArray) -> FloatArray:
    """(2,) the direction in which the first has to be moved least to be clear of the other in some frames."""
    paths = movers.paths({})
    one, other = (solid_mesh(movers, name, paths[name][frames[0]], int(frames[0])) for name in pair)
    away = one.vertices[:, :2].mean(0) - other.vertices[:, :2].mean(0)
    angles = np.arctan2(away[1], away[0]) + 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    needed = [max(_needed(movers, paths, pair, int(frame), direction) for frame in frames) for direction in directions]
    return np.asarray(directions[int(np.argmin(needed))])


def _needed(movers: Movers, paths: Mapping[str, FloatArray], pair: Pair, frame: int, direction: FloatArray) -> float:
    """How far the first has to be moved in a direction until the two are no deeper than they may be, m.

    Moving somebody by a way makes nobody less deep by more than that, so every step is by what is too deep still.
    """
    one, other = (solid_mesh(movers, name, paths[name][frame], frame) for name in pair)
    allowed, way = movers.allowed[pair][frame], 0.0
    while way <= FURTHEST:
        moved = Mesh(one.vertices + way * np.append(direction, 0.0), one.faces)
        over = sunk(moved, other) - allowed
        if over <= 0:
            break
        way += over + SPARE
    return way


def _bent(
    movers: Movers, runs: Sequence[_Run], depths: Mapping[Pair, FloatArray]
) -> tuple[dict[str, FloatArray], dict[str, float], Mapping[Pair, FloatArray]]:
    """Shifts (N, 2) by person, what each one's cost, m^2, and the depths that are left."""
    names = sorted({name for run in runs for name in run.pair if name in movers.edit.subjects})
    settings, edits = path_settings(movers.scene.optimise), movers.edit.subjects
    weights = np.array([shift_weights(movers.people[name].centres_at(edits[name].source), settings) for name in names])
    free = np.array([movers.free[name] for name in names])
    least = {run: np.zeros(movers.edit.n_frames) for run in runs}  # how far the first of each has to be moved, m
    shifts: dict[str, FloatArray] = {}
    best: tuple[dict[str, FloatArray], dict[str, float], Mapping[Pair, FloatArray]] = ({}, {}, depths)
    for _ in range(ROUNDS):
        paths = movers.paths(shifts)
        deep = {run: _too_deep(movers, run, depths) for run in least}
        if not any(len(frames) for frames in deep.values()):
            break
        for run, frames in deep.items():
            for frame in frames.tolist():
                least[run][frame] += _needed(movers, paths, run.pair, frame, run.direction)
        least = {run: own for run, own in least.items() if own.max() <= FURTHEST}
        if not least:
            break
        pushes = [push for run, own in least.items() for push in _pushes(names, run, own)]
        moved, paid = bent(weights, free, pushes, delta=settings.acceleration)
        shifts = dict(zip(names, moved, strict=True))
        depths = depths_of(movers, shifts)
        if _excess(movers, depths) < _excess(movers, best[2]):
            best = shifts, dict(zip(names, paid.tolist(), strict=True)), depths
    return best


def _pushes(names: Sequence[str], run: _Run, least: FloatArray) -> list[Push]:
    """What is asked of the two of a run, by (N,) m."""
    one, other = run.pair
    against = names.index(other) if other in names else None
    return [Push(int(k), names.index(one), against, run.direction, float(least[k])) for k in np.flatnonzero(least)]


def _too_deep(movers: Movers, run: _Run, depths: Mapping[Pair, FloatArray]) -> IntArray:
    """The frames of a run, and those next to it into which being too deep may have moved, that still are."""
    start, stop = max(int(run.frames[0]) - GAP, 0), int(run.frames[-1]) + GAP + 1
    return start + np.flatnonzero(depths[run.pair][start:stop] > movers.allowed[run.pair][start:stop])


def _bend(
    movers: Movers,
    run: _Run,
    after: Mapping[Pair, FloatArray],
    shifts: Mapping[str, FloatArray],
    costs: Mapping[str, float],
) -> Bend:
    """What became of a run, for the report."""
    worst = int(run.depth.argmax())
    moved = [float(np.linalg.norm(shifts[name], axis=1).max()) for name in run.pair if name in shifts]
    return Bend(
        between=run.pair,
        first=int(run.frames[0]),
        last=int(run.frames[-1]),
        before_mm=1000 * float(run.depth[worst]),
        after_mm=1000 * float(after[run.pair][run.frames].max()),
        allowed_mm=1000 * float(movers.allowed[run.pair][run.frames[worst]]),
        moved_mm=1000 * max(moved, default=0.0),
        cost=sum(costs.get(name, 0.0) for name in run.pair),
    )
