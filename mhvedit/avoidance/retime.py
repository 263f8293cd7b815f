"""Joint speeds limited by giving a motion more time (Degenhardt, future work; after Liu and Cohen 1995)."""

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Motion


def retimed(motion: Motion, speeds: FloatArray) -> Motion:
    """The same poses, slower where a DOF would be too fast.

    Every interval between two frames lasts as long as its fastest DOF needs, and never less than it did. The result is
    sampled at the same frame rate, so it may have more frames; a motion that is slow enough comes back as it was.

    Args:
        motion: to slow down.
        speeds: (D,) rad/s or m/s, largest that are allowed; inf for no limit.

    Raises:
        ShapeError: not one positive speed for each DOF.
    """
    if speeds.shape != (motion.q.shape[1],) or not (speeds > 0).all():
        raise ShapeError("speeds", speeds.shape, f"{motion.q.shape[1]} positive numbers")
    if motion.n_frames < 2:
        return motion
    needed = (np.abs(np.diff(motion.q, axis=0)) / speeds).max(1)
    if (needed <= 1 / motion.fps).all():
        return motion
    times = np.concatenate([[0.0], np.cumsum(np.maximum(needed, 1 / motion.fps))])
    n_frames = int(np.ceil(times[-1] * motion.fps - 1e-9)) + 1
    times *= (n_frames - 1) / (times[-1] * motion.fps)  # to the next whole frame: a little slower still
    wanted = np.arange(n_frames) / motion.fps
    return Motion(np.stack([np.interp(wanted, times, curve) for curve in motion.q.T], 1), motion.fps)
