"""How deep people are in each other, and in fixed props, where one of them is between key segments: on the meshes."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import combinations, product
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose, compose, invert, rotation, wrap_angle
from mhvedit.pipeline.bodies import Body, met, solids_of
from mhvedit.pipeline.keys import frames_key
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Arrays, Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.scene.edit import EditedScene, SubjectEdit
from mhvedit.scene.sinking import sunk
from mhvedit.sequences.meshes import Mesh, joined

VERSION: Final = 1  # of what is kept; raise it when depths change
STRANGERS: Final = 0.005  # m, how deep those who have nothing to do with each other may be: noise of the captures
DIGITS: Final = 9  # to which relative placements are the same, m and rad
NEAR: Final = 0.3  # m more than boxes, within which people are looked at

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Movers:
    """Everybody on the stage, and who may be shifted when; what stays the same while paths are bent."""

    scene: SceneFile
    edit: EditedScene
    people: Mapping[str, Person]
    props: Mapping[str, Prop]
    bodies: Mapping[str, Body]  # of people and of fixed props
    free: Mapping[str, BoolArray]  # (N,) by person, frames outside key segments
    allowed: Mapping[Pair, FloatArray]  # (N,) m, by pair
    workers: int

    def paths(self, shifts: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """(N, 3) placements of everybody when people are shifted by (N, 2); props stay."""
        still = np.zeros((self.edit.n_frames, 3))
        found = {name: np.tile(prop.place, (len(still), 1)) for name, prop in self.props.items()}
        for name, own in self.edit.subjects.items():
            found[name] = own.placements.copy()
            if name in shifts:
                found[name][:, :2] += shifts[name]
        return found


def frames_in_question(scene: SceneFile, edit: EditedScene, people: Mapping[str, Person]) -> dict[str, BoolArray]:
    """(N,) by person: frames in which one of two may give way, and their boxes could meet.

    Args:
        scene: the scene file.
        edit: with everybody on the stage.
        people: by name.
    """
    free, found = free_frames(scene, edit), {name: np.zeros(edit.n_frames, np.bool_) for name in edit.subjects}
    discs = {name: _discs(edit.subjects[name], people[name]) for name in edit.subjects}
    for one, other in combinations(edit.subjects, 2):
        (at_one, wide_one), (at_other, wide_other) = discs[one], discs[other]
        near = np.linalg.norm(at_one - at_other, axis=1) < wide_one + wide_other + NEAR
        for name in (one, other):
            found[name] |= near & (free[one] | free[other])
    return found


def _discs(edit: SubjectEdit, person: Person) -> tuple[FloatArray, FloatArray]:
    """(N, 2) m and (N,) m, middles and radii in plan of discs that hold somebody."""
    low, high = person.bounds[np.searchsorted(np.array(person.sequence.numbers), edit.source)].transpose(1, 0, 2)
    middle = 0.5 * (low + high)[:, :2]
    at = (rotation(edit.placements[:, 2]) @ middle[:, :, None])[..., 0] + edit.placements[:, :2]
    return at, 0.5 * np.linalg.norm((high - low)[:, :2], axis=1)


def movers_of(
    scene: SceneFile,
    edit: EditedScene,
    people: Mapping[str, Person],
    *,
    props: Mapping[str, Prop],
    bodies: Mapping[str, Body],
    workers: int,
) -> Movers:
    """Who may give way to whom.

    Args:
        scene: the scene file.
        edit: with everybody on the stage.
        people: by name.
        props: those that are fixed.
        bodies: of people and of these props, by name; whoever has none is left out.
        workers: threads.
    """
    pairs = [*combinations(edit.subjects, 2), *product(edit.subjects, props)]
    allowed = {pair: _allowed(scene, edit, pair) for pair in pairs if set(pair) <= bodies.keys()}
    return Movers(scene, edit, people, props, bodies, free_frames(scene, edit), allowed, workers)


def free_frames(scene: SceneFile, edit: EditedScene) -> dict[str, BoolArray]:
    """(N,) by person, frames in which she may be shifted."""
    free = {name: np.ones(edit.n_frames, np.bool_) for name in edit.subjects}
    for segment in edit.segments:
        for name in segment.between:
            free[name][segment.start : segment.stop] = False
    if scene.stage.pin is not None:
        free[scene.stage.pin][:] = False
    for mark in scene.stage.marks:
        free[mark.subject][edit.subjects[mark.subject].source == mark.frame] = False
    return free


def _allowed(scene: SceneFile, edit: EditedScene, pair: Pair) -> FloatArray:
    """(N,) m, how deep two may be in each frame: what the segments before and after it let them."""
    specs = {spec.name: spec for spec in scene.segments}
    own = [(s, _sinks(specs[s.name])) for s in edit.segments if set(s.between) == set(pair)]
    found = np.full(edit.n_frames, STRANGERS)
    for (before, one), (after, other) in zip([(None, 0.0), *own], [*own, (None, 0.0)], strict=True):
        start = 0 if before is None else before.start
        stop = edit.n_frames if after is None else after.stop
        found[start:stop] = np.maximum(found[start:stop], max(one, other))
    return found


def _sinks(spec: SegmentSpec) -> float:
    """How deep two may sink into each other in a segment, m."""
    return max(spec.tolerance.apart, spec.tolerance.depth if spec.interaction.touches else 0.0)


def depths_at_first(
    movers: Movers, store: Store, *, asked: Mapping[Pair, BoolArray] | None = None
) -> dict[Pair, FloatArray]:
    """The depths before anybody gives way, which are kept until frames or relative placements change.

    Args:
        movers: everybody.
        store: where depths are kept between runs.
        asked: see `depths_of`.
    """
    wanted = _movable_frames(movers) if asked is None else asked
    paths, pairs = movers.paths({}), list(wanted)
    key = [
        (
            [frames_of(movers, name, store) for name in pair],
            relative_placements(paths[pair[0]], paths[pair[1]]).tolist(),
            wanted[pair].tolist(),
        )
        for pair in pairs
    ]

    def build() -> Arrays:
        return {str(n): own for n, own in enumerate(depths_of(movers, {}, asked=wanted).values())}

    kept = store.arrays(("depths", VERSION, key), build)
    return {pair: np.asarray(kept[str(n)]) for n, pair in enumerate(pairs)}


def relative_placements(one: FloatArray, other: FloatArray) -> FloatArray:
    """(N, 3) where the other stands beside the one, rounded so that it is the same wherever the two are."""
    beside = compose(invert(one), other)
    beside[:, 2] = wrap_angle(beside[:, 2])
    return np.asarray(np.round(beside, DIGITS) + 0.0)  # no negative zeros: keys are made of what is written


def frames_of(movers: Movers, name: str, store: Store) -> object:
    """What the meshes of somebody or of a prop depend on."""
    if name in movers.props:
        prop = movers.props[name]
        return store.contents.of(prop.sequence.files), prop.spec.units, prop.spec.up
    spec, source = movers.scene.subjects[name], movers.edit.subjects[name].source
    frames = [frames_key(sequence, source, store.contents) for sequence in solids_of(movers.people[name])]
    return frames, spec.units, spec.up


def depths_of(
    movers: Movers, shifts: Mapping[str, FloatArray], *, asked: Mapping[Pair, BoolArray] | None = None
) -> dict[Pair, FloatArray]:
    """(N,) m by pair: how deep the two are in each other, 0 where that is not asked.

    Args:
        movers: everybody.
        shifts: (N, 2) m, of whoever is shifted.
        asked: (N,) by pair, the frames; None for those in which one of the two may be shifted.
    """
    paths = movers.paths(shifts)
    found = {}
    with ThreadPoolExecutor(movers.workers) as pool:
        for pair, wanted in (_movable_frames(movers) if asked is None else asked).items():
            near = met(movers.bodies[pair[0]], movers.bodies[pair[1]], paths[pair[0]], paths[pair[1]])
            frames = np.flatnonzero((near > 0) & wanted)
            depth = np.zeros(movers.edit.n_frames)
            depth[frames] = list(pool.map(partial(_depth, movers, paths, pair), frames.tolist()))
            found[pair] = depth
    return found


def _movable_frames(movers: Movers) -> dict[Pair, BoolArray]:
    """(N,) frames of each pair in which one of the two may be shifted."""
    return {pair: is_movable(movers, pair) for pair in movers.allowed}


def is_movable(movers: Movers, pair: Pair) -> BoolArray:
    """(N,) frames in which one of two may be shifted."""
    nobody = np.zeros(movers.edit.n_frames, np.bool_)
    return movers.free[pair[0]] | movers.free.get(pair[1], nobody)


def _depth(movers: Movers, paths: Mapping[str, FloatArray], pair: Pair, frame: int) -> float:
    """How deep two are in each other in a frame, m."""
    one, other = (solid_mesh(movers, name, paths[name][frame], frame) for name in pair)
    return sunk(one, other)


def solid_mesh(movers: Movers, name: str, pose: FloatArray, frame: int) -> Mesh:
    """All that is solid about somebody or a prop, placed."""
    if name in movers.props:
        whole = movers.props[name].mesh
    else:
        number = int(movers.edit.subjects[name].source[frame])
        whole = joined([sequence.mesh(number) for sequence in solids_of(movers.people[name])])
    return Mesh(apply_pose(pose, whole.vertices), whole.faces)
