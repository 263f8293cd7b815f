"""Everybody's coarse surfaces through a scene, and the things that stand in the way on the stage."""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose, compose, invert
from mhvedit.pipeline.keys import frames_key
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile
from mhvedit.scene.shells import Cells, Float32Array, Shells, cells_of, shell_of, stacked, touching
from mhvedit.sequences.meshes import Mesh, MeshSequence

VERSION: Final = 2  # of what is kept; raise it when shells change
THREADS: Final = 2


@dataclass(frozen=True, eq=False)  # no slots: of two who may meet, only one needs cells
class Body:
    """Somebody's shells through the scene, or those of a thing that does not move."""

    shells: Shells
    rows: IntArray  # (N,) which of the shells each frame of the scene shows; -1 where that is not known

    @cached_property
    def cells(self) -> Cells:
        """The shells as boxes of cells."""
        return cells_of(self.shells)


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What everybody has to keep clear of."""

    floor: FloatArray  # (C, 2) m, corners of a polygon; none: no limits
    obstacles: Mapping[str, Body]  # props that are fixed, on the stage

    @property
    def empty(self) -> bool:
        """Whether there is nothing to keep clear of."""
        return not len(self.floor) and not self.obstacles


def bodies_of(
    scene: SceneFile,
    people: Mapping[str, Person],
    sources: Mapping[str, IntArray],
    store: Store,
    *,
    wanted: Mapping[str, BoolArray] | None = None,
) -> dict[str, Body]:
    """Everybody's shells in the frames that a scene shows of them.

    Args:
        scene: the scene file.
        people: by name.
        sources: (N,) frame numbers by subject.
        store: where shells are kept between runs.
        wanted: (N,) by subject, frames in which they are needed; None for all.
    """
    everywhere = {name: np.ones(len(source), np.bool_) for name, source in sources.items()}
    asked = everywhere if wanted is None else wanted
    return {
        name: _body(scene, people[name], source, asked[name], store)
        for name, source in sources.items()
        if asked[name].any()
    }


def surroundings_of(scene: SceneFile, props: Mapping[str, Prop], n_frames: int) -> Surroundings:
    """Floor and fixed props of a scene.

    Args:
        scene: the scene file.
        props: opened.
        n_frames: of the edited scene.
    """
    still = np.zeros(n_frames, np.int64)
    obstacles = {}
    for name, prop in props.items():
        if prop.spec.kind == "fixed":
            placed = Mesh(apply_pose(prop.place, prop.mesh.vertices), prop.mesh.faces)
            obstacles[name] = Body(stacked([shell_of(placed)]), still)
    return Surroundings(np.array(scene.stage.floor, np.float64).reshape(-1, 2), obstacles)


def met(one: Body, other: Body, at_one: FloatArray, at_other: FloatArray, *, first: bool = False) -> IntArray:
    """In each frame how many points of one touch the other.

    Args:
        one: moves by (N, 3) placements `at_one`.
        other: by `at_other`.
        at_one: see there.
        at_other: see there.
        first: whether the first frame in which they touch is enough.
    """
    relative = compose(invert(at_other), at_one)
    return touching(one.shells, other.cells, frames=(one.rows, other.rows), relative=relative, first=first)


def frames_off_floor(body: Body, placements: FloatArray, floor: FloatArray) -> Iterator[int]:
    """Frames in which some of somebody is not over a floor.

    Args:
        body: moves by (N, 3) placements.
        placements: see there.
        floor: (C, 2) m; none: no limits.
    """
    for frame, (row, pose) in enumerate(zip(body.rows.tolist(), placements, strict=True)):
        if len(floor) and not inside(apply_pose(pose, body.shells.of(row))[:, :2], floor).all():
            yield frame


def inside(points: FloatArray, floor: FloatArray) -> BoolArray:
    """(N,) which points (N, 2) are inside a polygon (C, 2): a ray along x crosses its edges an odd number of times."""
    (x, y), (x0, y0) = points.T[:, :, None], floor.T
    x1, y1 = np.roll(floor, -1, axis=0).T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = spans & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return np.asarray(crossed.sum(1) % 2 == 1)


def _body(scene: SceneFile, person: Person, source: IntArray, wanted: BoolArray, store: Store) -> Body:
    numbers = np.unique(source[wanted])
    rows = np.where(wanted, np.searchsorted(numbers, source), -1)
    return Body(_shells(scene, person, numbers, store), rows)


def _shells(scene: SceneFile, person: Person, numbers: IntArray, store: Store) -> Shells:
    """Somebody's shells in some frames, ascending; those that no earlier edit has asked for are made and kept too."""
    spec, sequences = scene.subjects[person.subject.name], solids_of(person)
    frames = [frames_key(sequence, np.array(sequence.numbers), store.contents) for sequence in sequences]
    key = ("shells", VERSION, frames, spec.units, spec.up)

    def shell(number: int) -> Float32Array:
        return np.concatenate([shell_of(sequence.mesh(number)) for sequence in sequences])

    kept = store.kept(key)
    known = np.zeros(0, np.int64) if kept is None else kept["numbers"]
    missing = np.setdiff1d(numbers, known)
    if kept is None or len(missing):
        before = [] if kept is None else Shells(kept["points"], kept["stops"]).each()
        with ThreadPoolExecutor(THREADS) as pool:
            every = [*before, *pool.map(shell, missing.tolist())]
        order = np.argsort(np.append(known, missing))
        made = stacked([every[n] for n in order])
        known = np.append(known, missing)[order]
        kept = store.keep(key, {"numbers": known, "points": made.points, "stops": made.stops})
    return Shells(kept["points"], kept["stops"]).some(np.searchsorted(known, numbers))


def solids_of(person: Person) -> list[MeshSequence]:
    """The capture of somebody, and those of the things that she holds."""
    return [person.sequence, *person.subject.held.values()]
