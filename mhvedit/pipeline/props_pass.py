"""Props through the edited scene: once it is known who is where when, props get their poses."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.flags import frames_in_words, runs_of
from mhvedit.geometry.quaternions import quaternions_of, rotation_matrices, slerp
from mhvedit.pipeline.assemble import Assembly
from mhvedit.pipeline.keys import frames_key
from mhvedit.pipeline.shown import shown_subjects
from mhvedit.pipeline.store import Arrays, Key, Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile
from mhvedit.project.subjects import Subject
from mhvedit.scene.edit import EditedScene, PropEdit
from mhvedit.scene.report import SceneReport
from mhvedit.scene.shown import shown_scene
from mhvedit.skeleton.bvh import JointMotion

VERSION: Final = 1  # of what is kept; raise it when the simulation changes
NOTABLE: Final = 0.005  # m, that somebody may be inside a prop without a word
Track = tuple[FloatArray, FloatArray]  # positions (N, 3) m and rotations (N, 4) x, y, z, w


def with_props(
    scene: SceneFile, assembly: Assembly, subjects: Mapping[str, Subject], props: Mapping[str, Prop], store: Store
) -> Assembly:
    """The edited scene with its props: fixed ones stand, driven ones follow their motion, simulated ones are pushed.

    Args:
        scene: the scene file.
        assembly: of everybody.
        subjects: by name.
        props: by name.
        store: where simulations are kept between runs.

    Raises:
        CaptureError: a frame cannot be read.
    """
    if not props:
        return assembly
    edit, tracks = assembly.scene, dict[str, Track]()
    said = list(assembly.notes)
    for name, prop in props.items():
        tracks[name] = told_track(prop, edit.n_frames, edit.fps)
        said += _ended(prop, edit)
    if any(prop.spec.kind == "simulated" for prop in props.values()):
        from mhvedit.pipeline.props_world import simulated  # takes a second to load

        shown, people = shown_scene(edit), shown_subjects(subjects, edit)
        found = store.arrays(
            _key(scene, shown, people, props, store), lambda: simulated(shown, tracks, people, props, store)
        )
        tracks |= {name: (found[f"{name}:at"], found[f"{name}:turn"]) for name in props if f"{name}:at" in found}
        said += [str(sentence) for sentence in found["said"]]
    placed = {
        name: PropEdit(prop.spec.path.written, prop.spec.kind, shown_frames(prop, edit), *tracks[name])
        for name, prop in props.items()
    }
    return replace(assembly, scene=replace(edit, props=placed), notes=tuple(said))


def told_track(prop: Prop, n_frames: int, fps: float) -> Track:
    """Where a prop is if nothing pushes it.

    Args:
        prop: with its recorded motion, if it has one; after its end it stays where it is.
        n_frames: of the scene.
        fps: of the scene, Hz.
    """
    x, y, yaw = prop.place
    place = np.array([x, y, 0.0])
    turn = np.tile([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)], (n_frames, 1))
    if prop.motion is None:
        return np.tile(place, (n_frames, 1)), turn
    positions, rotations = _resampled(prop.motion, n_frames, fps)
    whole = rotation_matrices(turn[0])
    return positions @ whole.T + place, quaternions_of(whole @ rotation_matrices(rotations))


def shown_frames(prop: Prop, scene: EditedScene) -> IntArray:
    """(N,) captured frame that a prop shows in each frame of the scene.

    Args:
        prop: a driven one with captured frames and no other motion plays them at their rate, and then keeps the last.
        scene: the edit.
    """
    numbers = np.array(prop.sequence.numbers)
    if prop.spec.kind != "driven" or prop.motion is not None:
        return np.full(scene.n_frames, numbers[0])
    row = np.arange(scene.n_frames) * (prop.sequence.fps / scene.fps) + 1e-9
    return np.asarray(numbers[np.minimum(row.astype(np.int64), len(numbers) - 1)])


def entered(report: SceneReport, props: Mapping[str, Prop]) -> list[dict[str, Any]]:
    """Where people reach into props that stand, as `report.json` has it: one entry for each run of frames.

    Args:
        report: the check on the meshes.
        props: by name.
    """
    found = []
    for pair in report.pairs:
        who, what = pair.between
        for run in runs_of(pair.gap < -NOTABLE) if what in props else []:
            first, last, depth = run[0], run[-1], -1000 * float(pair.gap[run.start : run.stop].min())
            found.append(
                {
                    "subject": who, "prop": what, "first": first, "last": last, "depth_mm": round(depth, 1),
                    "sentence": f"{who} enters {what} by {depth:.0f} mm in {frames_in_words(first, last)}",
                }
            )  # fmt: skip
    return found


def _resampled(motion: JointMotion, n_frames: int, fps: float) -> Track:
    """A motion at the rate of the scene, from its first frame on."""
    at = np.minimum(np.arange(n_frames) * (motion.fps / fps), len(motion.positions) - 1)
    first = np.floor(at + 1e-9).astype(np.int64)
    last, share = np.minimum(first + 1, len(motion.positions) - 1), (at - first).clip(0.0)
    turns = quaternions_of(motion.rotations)
    positions = motion.positions[first] * (1 - share)[:, None] + motion.positions[last] * share[:, None]
    return positions, slerp(turns[first], turns[last], share)


def _ended(prop: Prop, scene: EditedScene) -> list[str]:
    """Say so where the motion of a prop is over before the scene is."""
    if prop.spec.kind != "driven":
        return []
    count, fps = len(prop.sequence.numbers), prop.sequence.fps
    if prop.motion is not None:
        count, fps = len(prop.motion.positions), prop.motion.fps
    over = int(np.ceil((count - 1) * scene.fps / fps - 1e-6)) + 1
    if over >= scene.n_frames:
        return []
    return [f"{prop.spec.key}: its motion is over after {over} of {scene.n_frames} frames; from then on it keeps still"]


def _key(
    scene: SceneFile, edit: EditedScene, subjects: Mapping[str, Subject], props: Mapping[str, Prop], store: Store
) -> Key:
    """Everything that simulated props depend on."""
    known = store.contents
    people = []
    for name, own in edit.subjects.items():
        spec = scene.subjects[name]
        solids = {"": subjects[name].sequence, **subjects[name].held}
        frames = [(part, frames_key(sequence, own.source, known)) for part, sequence in solids.items()]
        people.append((name, frames, spec.units, spec.up, own.placements.tolist()))
    bodies = []
    for name, prop in props.items():
        thing, asked = prop.spec, prop.spec.motion
        motion = None if asked is None else (known.of([asked.path.path]), asked.joint, asked.units, asked.up)
        what = (thing.kind, thing.material, thing.mass, thing.place, thing.units, thing.up)
        bodies.append((name, known.of(prop.sequence.files), prop.sequence.numbers, prop.sequence.fps, what, motion))
    return ("props", VERSION, edit.fps, edit.n_frames, people, bodies)


def as_arrays(tracks: Mapping[str, Track], said: list[str]) -> Arrays:
    """Tracks and sentences as they are kept."""
    arrays: dict[str, NDArray[Any]] = {"said": np.array(said, np.str_)}
    for name, (positions, rotations) in tracks.items():
        arrays |= {f"{name}:at": positions, f"{name}:turn": rotations}
    return arrays
