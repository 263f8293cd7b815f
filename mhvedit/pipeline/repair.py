"""Captures that get equipment or another girth: a skeleton is fitted, what then meets is freed, the meshes follow.

This happens before anything else looks at a capture. The repaired one is kept in the cache and takes the captured one's
place: volumes, facing, the check and exports read the same meshes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.avoidance.equipment import attach
from mhvedit.avoidance.guards import MeshGuard
from mhvedit.avoidance.methods import Avoided, Problem, touched_frames
from mhvedit.collision.detect import CollisionBody, collision_body
from mhvedit.collision.pairs import LimbPairs
from mhvedit.errors import CaptureError, SceneError
from mhvedit.files import load_npz
from mhvedit.fitting.body import BodyInMotion, body_in_motion, grown
from mhvedit.fitting.capture import CaptureFit, fit_capture
from mhvedit.fitting.deform import BoneFrames, deformed
from mhvedit.fitting.joints import NAMES, PARENTS, joint
from mhvedit.fitting.quality import FitRefused, jumps, refusals
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.pipeline.avoid import Method, avoid_collisions, avoidance_problem
from mhvedit.pipeline.avoid_report import reasons
from mhvedit.pipeline.keys import frames_key
from mhvedit.pipeline.packing import packed_capture
from mhvedit.pipeline.store import Arrays, Key, Store, kept_file
from mhvedit.project.schema import EquipmentSpec, SceneFile, SelfCollisionSpec, SubjectSpec
from mhvedit.project.subjects import Subject
from mhvedit.sequences.axes import to_metres_z_up
from mhvedit.sequences.formats import parse_mesh
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import open_capture
from mhvedit.skeleton.forward import joint_frames
from mhvedit.view.skeletons import FittedStory, write_fitted_strip

VERSION: Final = 1  # of what is kept; raise it when a repair changes
SHOWN: Final = 6  # frames of a picture
ADDED: Final = -1  # label of vertices that belong to equipment


@dataclass(frozen=True, slots=True, eq=False)
class _Equipment:
    """A closed mesh on a limb."""

    limb: int  # joint
    local: FloatArray  # (V, 3) m, in the limb's frame at rest
    faces: Int32Array  # (F, 3)


def repaired_subjects(
    scene: SceneFile, subjects: Mapping[str, Subject], store: Store, *, workers: int
) -> dict[str, Subject]:
    """Subjects with repaired captures, where the scene file asks for that.

    Args:
        scene: the scene file.
        subjects: opened.
        store: where repaired captures are kept.
        workers: threads; the result does not depend on it.

    Raises:
        FitRefused: no skeleton fits a capture in all frames that are used.
        CaptureError: equipment cannot be used, or the limbs cannot be kept apart.
        SceneError: equipment belongs to a frame that the capture does not have.
    """
    return {
        name: subject
        if (spec := scene.subjects[name]).self_collision is None
        else replace(subject, sequence=_repaired(subject, spec, spec.self_collision, store, workers))
        for name, subject in subjects.items()
    }


def repaired_story(sequence: MeshSequence) -> FittedStory:
    """Some frames of a repaired capture, with its skeleton; edited frames are marked.

    Args:
        sequence: repaired.
    """
    kept = load_npz(sequence.files[0], "joints", "touched")
    return _story(sequence, kept["joints"], kept["touched"].tolist())


def repaired_in_words(sequence: MeshSequence) -> str:
    """What was done to a repaired capture.

    Args:
        sequence: repaired.
    """
    kept = load_npz(sequence.files[0], "touched", "collided")
    touched, collided = int(kept["touched"].sum()), int(kept["collided"].sum())
    return (
        f"Repaired: limbs met in {collided} of {len(sequence.numbers)} frames; the posture was changed in {touched} "
        "and in no other."
    )


def _story(sequence: MeshSequence, joints: FloatArray, marked: Sequence[bool]) -> FittedStory:
    """A few frames, evenly apart."""
    rows = np.unique(np.linspace(0, len(sequence.numbers) - 1, SHOWN).round().astype(int)).tolist()
    numbers = [sequence.numbers[row] for row in rows]
    points = [sequence.mesh(number).vertices for number in numbers]
    return FittedStory(numbers, points, joints[rows], PARENTS, [marked[row] for row in rows])


def _repaired(
    subject: Subject, spec: SubjectSpec, asked: SelfCollisionSpec, store: Store, workers: int
) -> MeshSequence:
    """The repaired capture, from the cache if it is there."""
    sequence = subject.sequence
    key = _key(subject, spec, asked, store)
    refused = None if store.folder is None else store.folder / "repaired" / f"refused_{subject.name}.webp"
    build = partial(_arrays, sequence, spec, asked, workers, refused=refused)
    place = kept_file(store, key, build, told="vertex_counts")
    return open_capture(place, name=sequence.name, fps=sequence.fps)


def _key(subject: Subject, spec: SubjectSpec, asked: SelfCollisionSpec, store: Store) -> Key:
    """All that a repaired capture depends on."""
    sequence = subject.sequence
    frames = frames_key(sequence, np.array(sequence.numbers), store.contents)
    things = [(store.contents.of([thing.path.path]), thing.limb, thing.frame) for thing in asked.equipment]
    girth = sorted(asked.girth.items())
    return ("repaired", VERSION, frames, sequence.fps, spec.units, spec.up, asked.method, things, girth)


def _arrays(
    sequence: MeshSequence, spec: SubjectSpec, asked: SelfCollisionSpec, workers: int, *, refused: Path | None
) -> Arrays:
    """The repaired capture as the arrays of an .npz, with its joints and which frames were changed."""
    _check_frames(asked, spec, sequence)
    fit = fit_capture(sequence, workers=workers)
    why = refusals(fit.likeness, fit.numbers.tolist(), fit.frames)
    why += jumps(fit.numbers.tolist(), fit.places, fps=sequence.fps)
    if why:
        if refused is not None:
            write_fitted_strip(refused, _story(sequence, fit.places, [not frame.usable for frame in fit.frames]))
        raise FitRefused(sequence.name, why, picture=refused)
    girth = np.array([asked.girth.get(name, 1.0) for name in NAMES])
    moving = body_in_motion(fit, fps=sequence.fps)
    if (girth != 1.0).any():
        moving = grown(moving, fit.template, girth)
    things = [_opened(thing, fit, moving, spec) for thing in asked.equipment]
    avoided = _freed(sequence.name, moving, things, girth, asked, workers)
    meshes = _meshes(sequence, fit, moving, things, girth, avoided)
    return {
        **packed_capture(meshes, sequence.numbers, fps=sequence.fps),
        "joints": joint_frames(moving.body.skeleton, avoided.motion.q)[1],
        "touched": touched_frames(moving.motion, avoided.motion),
        "collided": avoided.before > 0,
    }


def _check_frames(asked: SelfCollisionSpec, spec: SubjectSpec, sequence: MeshSequence) -> None:
    """The capture has the frames that equipment belongs to."""
    for i, thing in enumerate(asked.equipment):
        if thing.frame not in sequence.numbers:
            expected = f"a frame of the capture, from {sequence.numbers[0]} to {sequence.numbers[-1]}"
            raise SceneError(spec.file, f"{spec.key}.self_collision.equipment.{i}.frame", expected, str(thing.frame))


def _opened(thing: EquipmentSpec, fit: CaptureFit, moving: BodyInMotion, spec: SubjectSpec) -> _Equipment:
    """A thing, taken from the frame in which it is where it belongs to the limb at rest."""
    path = thing.path.path
    try:
        raw = parse_mesh(path.read_bytes(), path)
    except OSError as fault:
        raise CaptureError(path, "a readable mesh", str(fault.strerror)) from fault
    at, j = int(np.searchsorted(fit.numbers, thing.frame)), joint(thing.limb)
    vertices = to_metres_z_up(raw.vertices, units=spec.units, up=spec.up)
    turn = fit.rotations[at, j] @ moving.rest_from_bind[j].T
    return _Equipment(j, (vertices - fit.places[at, j]) @ turn, raw.faces)


def _freed(
    name: str,
    moving: BodyInMotion,
    things: Sequence[_Equipment],
    girth: FloatArray,
    asked: SelfCollisionSpec,
    workers: int,
) -> Avoided:
    """The motion with its limbs apart. Raises CaptureError where they cannot be kept apart."""
    body, rest = moving.body, moving.body.skeleton.rest_positions
    for thing in things:
        body = attach(body, thing.local + rest[thing.limb], thing.faces, limb=NAMES[thing.limb])
    problem, ready = avoidance_problem(body, moving.motion, workers=workers)
    changed = {*np.flatnonzero(girth != 1.0).tolist(), *(thing.limb for thing in things)}
    if changed:
        problem, ready = _only_pairs_of(problem, ready, changed, workers)
    avoided = avoid_collisions(problem, Method(asked.method))
    if not avoided.converged:
        raise CaptureError(name, "limbs that can be kept apart", "; ".join(reasons(ready, avoided)))
    return avoided


def _only_pairs_of(
    problem: Problem, ready: CollisionBody, changed: set[int], workers: int
) -> tuple[Problem, CollisionBody]:
    """Only what is new can meet: real people do not run through themselves, other pairs are faults of the fit."""
    joints = ready.limbs.arrays.joints[ready.pairs.limbs]
    ready = collision_body(ready.body, pairs=LimbPairs(ready.pairs.limbs[np.isin(joints, list(changed)).any(1)]))
    return replace(problem, body=replace(problem.body, guard=MeshGuard(ready, workers=workers))), ready


def _meshes(
    sequence: MeshSequence,
    fit: CaptureFit,
    moving: BodyInMotion,
    things: Sequence[_Equipment],
    girth: FloatArray,
    avoided: Avoided,
) -> list[Mesh]:
    """Every frame of the capture, deformed where its bones moved, with its equipment."""
    touched = touched_frames(moving.motion, avoided.motion)
    posed, places = joint_frames(moving.body.skeleton, avoided.motion.q)
    meshes = []
    for at, number in enumerate(sequence.numbers):
        before = BoneFrames(fit.rotations[at], fit.places[at])
        after = BoneFrames(posed[at] @ moving.rest_from_bind, places[at]) if touched[at] else before
        mesh = deformed(sequence.mesh(number), fit.template, before, after, girth=girth)
        for thing in things:
            turn = after.turns[thing.limb] @ moving.rest_from_bind[thing.limb].T
            mesh = _with(mesh, thing.local @ turn.T + after.places[thing.limb], thing.faces)
        meshes.append(mesh)
    return meshes


def _with(mesh: Mesh, vertices: FloatArray, faces: Int32Array) -> Mesh:
    """A mesh and a thing."""
    labels = None if mesh.labels is None else np.concatenate([mesh.labels, np.full(len(vertices), ADDED, np.int32)])
    added = np.asarray(faces + len(mesh.vertices), np.int32)
    return Mesh(np.concatenate([mesh.vertices, vertices]), np.concatenate([mesh.faces, added]), labels)
