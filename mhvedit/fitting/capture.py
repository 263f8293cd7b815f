"""A skeleton for every frame of a capture: automatic start, own surface as template, every frame judged."""

from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from mhvedit.fitting.fit import FROM_NEAR, Pose, Target, fit_joints, fit_pose, joint_places, target
from mhvedit.fitting.joints import places_in
from mhvedit.fitting.quality import FrameFit, Likeness, likeness, measure_frame
from mhvedit.fitting.start import binding_frame, starting_poses
from mhvedit.fitting.template import Template, bind
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.bodies import BodyTrack, track_body
from mhvedit.sequences.meshes import MeshSequence

N_LEARNED: Final = 24  # frames from which the joints' places are found
ROUNDS: Final = 10  # in which their poses and the joints' places are improved in turn
SETTLING: Final = 8  # rounds in which a frame forgets the bends that it started with


@dataclass(frozen=True, slots=True, eq=False)
class CaptureFit:
    """A subject's own skeleton in every frame of its capture."""

    numbers: IntArray  # (T,) frame numbers
    template: Template
    rotations: FloatArray  # (T, J, 3, 3) bind frame to posed frame
    places: FloatArray  # (T, J, 3) m, joints
    frames: Sequence[FrameFit]  # T, how well each is met
    likeness: Likeness  # how like a person the capture is at all


def fit_capture(sequence: MeshSequence, *, workers: int = 1) -> CaptureFit:
    """Fit a skeleton to a capture; whether it may be used is for `quality.refusals` to say.

    Args:
        sequence: the capture.
        workers: threads; the result does not depend on it.
    """
    track = track_body(sequence, workers=workers)
    bound = binding_frame(track)
    starts = starting_poses(track, bound)
    template = bind(sequence.mesh(int(track.numbers[bound])), track, bound)
    with ThreadPoolExecutor(workers) as pool:
        template = _learned(sequence, track, template, starts, pool)
        shift = template.rest[0] - places_in(track)[bound, 0]
        starts = [Pose(start.rotations, start.pelvis + start.rotations[0] @ shift) for start in starts]
        found = list(pool.map(partial(_fitted, sequence, template), track.numbers.tolist(), starts))
    poses = [pose for pose, _ in found]
    return CaptureFit(
        track.numbers,
        template,
        np.array([pose.rotations for pose in poses]),
        np.array([joint_places(template.rest, pose) for pose in poses]),
        tuple(frame for _, frame in found),
        likeness(template, track),
    )


def _learned(
    sequence: MeshSequence, track: BodyTrack, template: Template, starts: Sequence[Pose], pool: Executor
) -> Template:
    """The template with its joints where the bones turn."""
    chosen = np.unique(np.linspace(0, len(starts) - 1, N_LEARNED).round().astype(int))
    goals: list[Target] = list(pool.map(lambda at: target(sequence.mesh(int(track.numbers[at]))), chosen))
    seen = places_in(track)[chosen]
    template, _ = fit_joints(template, goals, [starts[at] for at in chosen], seen, rounds=ROUNDS, pool=pool)
    return template


def _fitted(sequence: MeshSequence, template: Template, number: int, start: Pose) -> tuple[Pose, FrameFit]:
    """The pose in one frame, and how well it is met."""
    goal = target(sequence.mesh(number))
    pose = fit_pose(template, goal, start)
    for _ in range(SETTLING):
        pose = fit_pose(template, goal, pose, reach=FROM_NEAR)
    return pose, measure_frame(template, goal, pose)
