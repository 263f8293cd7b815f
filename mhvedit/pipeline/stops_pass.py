"""Hands stop at fixed props: once everybody is placed, whoever reaches into a prop gets meshes that do not.

Nothing is done, read or kept where there are no fixed props. What is made belongs to frames of the scene, not to
captured ones: a captured frame may be shown twice, at different places.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from mhvedit.files import load_npz
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.flags import frames_in_words
from mhvedit.pipeline.assemble import Assembly, Stop
from mhvedit.pipeline.bodies import bodies_of, surroundings_of
from mhvedit.pipeline.depths import Movers, depths_at_first, frames_of, movers_of, relative_placements
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Arrays, Key, Store, kept_file
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile
from mhvedit.scene.touched import open_touched

VERSION: Final = 1  # of what is kept; raise it when stopped meshes change
DEEP: Final = 0.003  # m inside a prop, from which somebody is stopped
TOLD: Final = "told"  # array beside the meshes: what is said about them, as JSON


def with_stops(
    scene: SceneFile,
    assembly: Assembly,
    people: Mapping[str, Person],
    props: Mapping[str, Prop],
    store: Store,
    *,
    workers: int,
) -> Assembly:
    """The edited scene with limbs that stop at fixed props; the same where nobody reaches into one.

    Args:
        scene: the scene file.
        assembly: of everybody.
        people: by name.
        props: by name.
        store: where stopped meshes are kept between runs.
        workers: threads; the result does not depend on it.

    Raises:
        CaptureError: a frame cannot be read.
    """
    stopping = {name: prop for name, prop in props.items() if prop.spec.kind == "fixed" and prop.spec.stops}
    if not stopping:
        return assembly
    movers = _movers(scene, assembly, people, stopping, store, workers)
    n = assembly.scene.n_frames
    pairs = product(assembly.scene.subjects, stopping)
    depths = depths_at_first(movers, store, asked={pair: np.ones(n, np.bool_) for pair in pairs})
    subjects, stops, said = dict(assembly.scene.subjects), list(assembly.stops), list(assembly.notes)
    for name, edit in subjects.items():
        own = {prop: depths[name, prop] for prop in stopping}
        if max(float(depth.max(initial=0.0)) for depth in own.values()) <= DEEP:
            continue
        place = kept_file(store, _key(movers, name, store), partial(_build, movers, name, own, store), told=TOLD)
        told = json.loads(str(load_npz(place, TOLD)[TOLD]))
        stops += [Stop(**{**stop, "limbs": tuple(stop["limbs"])}) for stop in told["stops"]]
        said += told["notes"]
        if told["frames"]:
            subjects[name] = replace(edit, touched=open_touched(place))
    return replace(assembly, scene=replace(assembly.scene, subjects=subjects), stops=tuple(stops), notes=tuple(said))


def stop_in_words(stop: Stop) -> str:
    """What became of a run of frames, in a sentence."""
    where = frames_in_words(stop.first, stop.last)
    if not stop.limbs:
        return f"{stop.subject} stays {stop.before_mm:.0f} mm inside {stop.prop} in {where}: {stop.why}"
    said = (
        f"{stop.subject}: {' and '.join(stop.limbs)} stopped at {stop.prop} in {where}, "
        f"{stop.before_mm:.0f} mm deep as captured, {stop.after_mm:.0f} mm now; "
        f"{stop.joint} turns by {stop.turned_deg:.0f} degrees"
    )
    return f"{said}. What is left: {stop.why}" if stop.why else said


def _movers(
    scene: SceneFile,
    assembly: Assembly,
    people: Mapping[str, Person],
    props: Mapping[str, Prop],
    store: Store,
    workers: int,
) -> Movers:
    """Everybody, and the props that stop people."""
    edit = assembly.scene
    bodies = bodies_of(scene, people, {name: own.source for name, own in edit.subjects.items()}, store)
    obstacles = surroundings_of(scene, props, edit.n_frames).obstacles
    return movers_of(scene, edit, people, props=props, bodies={**bodies, **obstacles}, workers=workers)


def _key(movers: Movers, name: str, store: Store) -> Key:
    """All that somebody's stopped meshes depend on: everybody's frames, and where they stand beside her."""
    from mhvedit.pipeline.fitted import VERSION as FITS  # takes long to load, and few scenes need it

    paths, spec = movers.paths({}), movers.scene.subjects[name]
    others = [
        (other, frames_of(movers, other, store), relative_placements(paths[name], paths[other]).tolist())
        for other in paths
        if other != name
    ]
    held = list(movers.people[name].subject.held)  # the names that stopped things are read by
    return ("stopped", VERSION, FITS, name, held, frames_of(movers, name, store), spec.fps, others)


def _build(movers: Movers, name: str, depths: Mapping[str, FloatArray], store: Store) -> Arrays:
    """Somebody's stopped meshes as the arrays of an .npz capture, and what is told about them."""
    from mhvedit.pipeline.stops_person import stopped_meshes  # takes a second to load, and few scenes need it

    return stopped_meshes(movers, name, depths, store)
