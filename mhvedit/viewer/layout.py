"""Where the panels of a viewer are, for the window and for pictures alike."""

from dataclasses import dataclass

MAP_SHARE = 0.34  # of the width
TIMELINE = 84  # pixels high


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle on the picture, pixels from its upper left corner."""

    left: int
    top: int
    width: int
    height: int

    def holds(self, x: float, y: float) -> bool:
        """Whether a pixel is inside."""
        return 0 <= x - self.left < self.width and 0 <= y - self.top < self.height


@dataclass(frozen=True, slots=True)
class Layout:
    """The three panels."""

    scene: Box
    map: Box
    timeline: Box


def layout_of(width: int, height: int) -> Layout:
    """The panels of a window: the scene, the map on its right, the time line below both.

    Args:
        width: pixels.
        height: pixels.
    """
    above = height - TIMELINE
    beside = min(round(MAP_SHARE * width), above)
    return Layout(
        Box(0, 0, width - beside, above), Box(width - beside, 0, beside, above), Box(0, above, width, TIMELINE)
    )
