"""Frames at which something holds, as runs of frames, and in words."""

import numpy as np

from mhvedit.geometry.arrays import BoolArray


def runs_of(which: BoolArray) -> list[range]:
    """Where flags are set.

    >>> runs_of(np.array([False, True, True, False, True]))
    [range(1, 3), range(4, 5)]

    Args:
        which: (N,).
    """
    edges = np.flatnonzero(np.diff(which.astype(np.int8), prepend=0, append=0))
    return [range(int(first), int(past)) for first, past in zip(edges[::2], edges[1::2], strict=True)]


def frames_in_words(first: int, last: int) -> str:
    """A run of frames.

    >>> frames_in_words(3, 3), frames_in_words(3, 5)
    ('frame 3', 'frames 3 to 5')
    """
    return f"frame {first}" if first == last else f"frames {first} to {last}"
