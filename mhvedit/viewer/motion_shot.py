"""Pictures of a motion without a window: the body before and after, and depth over time."""

import numpy as np

from mhvedit.geometry.arrays import ByteArray
from mhvedit.view.studio import studio
from mhvedit.viewer.motion import MotionState, status
from mhvedit.viewer.motion3d import MotionStage, stage_picture
from mhvedit.viewer.motion_strip import HEIGHT, strip_picture
from mhvedit.viewer.shot import SIZE, with_words


def motion_shot(state: MotionState, *, size: tuple[int, int] = SIZE) -> ByteArray:
    """(H, W, 3) what the viewer shows of a motion.

    Args:
        state: to be shown.
        size: width and height, pixels.

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    width, height = size
    with studio(width, height - HEIGHT) as plotter:
        bodies = stage_picture(MotionStage(plotter, state.material), state)
    return np.concatenate([with_words(bodies, status(state)), strip_picture(state, width=width, height=HEIGHT)])
