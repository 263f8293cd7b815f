"""The stopped meshes of one person: skeleton, stretches of frames, and what has to be said where there is no way."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import MhveditError
from mhvedit.fitting.body import body_in_motion
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.pipeline.assemble import Stop
from mhvedit.pipeline.depths import Movers, solid_mesh
from mhvedit.pipeline.fitted import kept_fit, why_refused
from mhvedit.pipeline.packing import packed_capture
from mhvedit.pipeline.props_world import prop_body
from mhvedit.pipeline.stops_actor import Actor
from mhvedit.pipeline.stops_flesh import holder_of
from mhvedit.pipeline.stops_pass import TOLD
from mhvedit.pipeline.stops_stretch import Stopped, stopped, windows_of
from mhvedit.pipeline.store import Arrays, Store
from mhvedit.scene.touched import THING
from mhvedit.sequences.meshes import Mesh
from mhvedit.world.bodies import Body
from mhvedit.world.materials import load_materials
from mhvedit.world.problems import WorldError

Depths = Mapping[str, FloatArray]  # (N,) m by prop


def stopped_meshes(movers: Movers, name: str, depths: Depths, store: Store) -> Arrays:
    """Somebody's meshes in the frames in which they are stopped, and what is told about them.

    Args:
        movers: everybody, and the props that stop people.
        name: of the person.
        depths: how deep she is as captured.
        store: where fits and convex pieces are kept.
    """
    bodies, notes = _bodies(movers, store)
    solid = {prop: own for prop, own in depths.items() if prop in bodies}
    if not solid:
        return _packed((), notes, fps=1.0)
    windows = windows_of(solid, movers.edit.n_frames)
    actor, refused = _actor(movers, name, bodies, np.concatenate(windows).astype(np.int64), store)
    if actor is None:
        return _packed((), [*notes, refused], fps=1.0)
    results = [stopped(actor, name, window, solid) for window in windows]
    return _packed(results, notes, fps=movers.edit.fps)


def _bodies(movers: Movers, store: Store) -> tuple[dict[str, Body], list[str]]:
    """Convex pieces of the props, and sentences on props that have none."""
    materials, found, said = load_materials(), dict[str, Body](), list[str]()
    for name, prop in movers.props.items():
        try:
            found[name] = prop_body(prop, materials, store)
        except WorldError as fault:
            said.append(f"{prop.spec.key}: nobody is stopped at it: expected {fault.expected}, found {fault.found}")
    return found, said


def _actor(
    movers: Movers, name: str, bodies: Mapping[str, Body], frames: IntArray, store: Store
) -> tuple[Actor | None, str]:
    """The person with a skeleton; None, and why, where none fits in the frames that are to be edited."""
    edit, subject, spec = movers.edit.subjects[name], movers.people[name].subject, movers.scene.subjects[name]
    shown, edited = np.unique(edit.source), np.unique(edit.source[frames])
    try:
        fit = kept_fit(subject.sequence, shown, store, axes=(spec.units, spec.up), workers=movers.workers)
        why = why_refused(fit, edited, fps=subject.sequence.fps)
    except (MhveditError, np.linalg.LinAlgError) as fault:
        return None, _refusal(name, [str(fault)])
    if why:
        return None, _refusal(name, why)
    things = subject.held
    places = fit.places[np.searchsorted(fit.numbers, edited)]
    hands = {part: holder_of([own.mesh(int(n)) for n in edited], places) for part, own in things.items()}
    paths = movers.paths({})

    def others(frame: int) -> list[Mesh]:
        return [solid_mesh(movers, o, paths[o][frame], frame) for o in movers.edit.subjects if o != name]

    actor = Actor(
        edit=edit,
        capture=subject.sequence,
        things=things,
        holders={part: hand for part, hand in hands.items() if hand is not None},
        fit=fit,
        moving=body_in_motion(fit, fps=subject.sequence.fps),
        props={prop: movers.props[prop] for prop in bodies},
        bodies=bodies,
        others=others,
    )
    return actor, ""


def _refusal(name: str, why: Sequence[str]) -> str:
    more = f" (and {len(why) - 1} more reasons)" if len(why) > 1 else ""
    return f"{name} is not stopped at props, as no skeleton fits: {why[0]}{more}"


def _packed(results: list[Stopped] | tuple[()], notes: list[str], *, fps: float) -> Arrays:
    """As an .npz: a capture whose frames are those of the scene."""
    frames = [frame for own in results for frame in own.frames]
    stops: list[Stop] = [stop for own in results for stop in own.stops]
    told = {"frames": frames, "stops": [asdict(stop) for stop in stops], "notes": notes}
    arrays: dict[str, NDArray[Any]] = {TOLD: np.array(json.dumps(told))}
    if frames:
        arrays |= packed_capture([mesh for own in results for mesh in own.meshes], frames, fps=fps)
        moving = [own for own in results if own.frames]
        for part in moving[0].things:
            arrays[f"{THING}{part}"] = np.concatenate([own.things[part] for own in moving])
    return arrays
