"""Values over time without the noise of single frames."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray

REACH = 4.0  # standard deviations, beyond which nothing counts


def smoothed(values: FloatArray, width: float) -> FloatArray:
    """Values averaged over their neighbours with the weights of a Gauss curve; the ends go on as they are.

    What `scipy.ndimage.gaussian_filter1d` finds; to import that takes longer than an answer may take for it.

    Args:
        values: (N, ...), at least one.
        width: standard deviation, in values; 0 leaves them as they are.
    """
    half = int(REACH * width + 0.5)
    if half == 0:
        return values
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    ends = [(half, half)] + [(0, 0)] * (values.ndim - 1)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(values, ends, mode="edge"), len(weights), axis=0)
    return np.asarray(around @ (weights / weights.sum()))
