"""Which way a person's body faces: given by a track, or found from the geometry of a capture without a skeleton."""

import numpy as np

from mhvedit.errors import SceneError, ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.smoothing import smoothed
from mhvedit.sequences.bodies import BodyTrack, across_body, horizontal_front
from mhvedit.sequences.meshes import Facing, JointTracks

SMOOTHING = 0.04  # s, standard deviation of the smoothing over time
MISFIT_SCALE = 7e-4  # m^2, misfit at which the trust has halved


def facing_of_body(body: BodyTrack, *, fps: float) -> Facing:
    """Which way the body faces in every frame: the horizontal normal of hips and shoulders.

    The estimate turns with the capture. Trust falls where the left-right axis is steep (lying on the side) and where
    the body does not fit.

    Args:
        body: the body that was tracked in the capture.
        fps: Hz, of the capture.
    """
    across = across_body(body.places)
    flat = _smooth(across[:, :2], body, SMOOTHING * fps)
    level = np.linalg.norm(across[:, :2], axis=1)
    trust = np.clip(level, 0.0, 1.0) / (1.0 + (body.misfit / MISFIT_SCALE) ** 2)
    return Facing(body.numbers, horizontal_front(flat), np.clip(trust, 0.0, 1.0))


def facing_from_tracks(tracks: JointTracks) -> Facing:
    """The facing that the joint `facing` (or the only joint there is) of a track file gives as a vector.

    Args:
        tracks: directions in the place of positions; their vertical part and length don't matter.

    Raises:
        SceneError: there is no such joint, or a frame's direction is missing or vertical.
    """
    direction = single_joint(tracks, "facing")
    bad = ~(np.linalg.norm(direction[:, :2], axis=1) > 1e-9)
    if bad.any():
        found = f"none in frame {tracks.numbers[np.argmax(bad)]}"
        raise SceneError("track", "facing", "a direction with a horizontal part in every frame", found)
    return Facing(tracks.numbers, np.arctan2(direction[:, 1], direction[:, 0]), np.ones(len(direction)))


def single_joint(tracks: JointTracks, name: str) -> FloatArray:
    """The positions (T, 3) of a joint by its name, or of the only joint whatever its name.

    Args:
        tracks: the track file.
        name: which joint is wanted.

    Raises:
        ShapeError: the positions are not (T, J, 3).
        SceneError: several joints, none of that name.
    """
    if tracks.positions.shape != (len(tracks.numbers), len(tracks.joints), 3):
        raise ShapeError("positions", tracks.positions.shape, (len(tracks.numbers), len(tracks.joints), 3))
    if name in tracks.joints:
        return tracks.positions[:, tracks.joints.index(name)]
    if len(tracks.joints) == 1:
        return tracks.positions[:, 0]
    raise SceneError("track", "joint", f"a joint `{name}`, or a single joint", ", ".join(tracks.joints) or "no joints")


def _smooth(flat: FloatArray, body: BodyTrack, frames: float) -> FloatArray:
    """Average (T, 2) vectors over neighbouring frames; gaps in the numbering are ignored."""
    if len(body.numbers) < 2 or frames <= 0:
        return flat
    return smoothed(flat, frames)
