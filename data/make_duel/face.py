"""Neck, head, face and hair."""

from __future__ import annotations

import numpy as np

from .field import ball, cone
from .figure import Figure, Posed
from .vectors import Floats, unit, vec

SIDES = (-1.0, 1.0)


def head_shapes(figure: Figure, posed: Posed) -> list[Floats]:
    """Everything above the collar."""
    hair = _ponytail(figure, posed) if figure.ponytail else _cropped(figure, posed)
    return _skull(figure, posed) + hair + _features(figure, posed)


def _spot(figure: Figure, posed: Posed, x: float, y: float, z: float) -> Floats:
    """A point of the head: x forward, y left, z up from between the ears."""
    return np.asarray(posed.joints["Head"] + posed.frames["head"] @ vec(x, y, z) * figure.head)


def _lump(
    figure: Figure,
    posed: Posed,
    at: tuple[float, float, float],
    radii: tuple[float, float, float],
    blend: float,
    carve: bool = False,
) -> Floats:
    """An ellipsoid of the head."""
    s = figure.head
    sized = (radii[0] * s, radii[1] * s, radii[2] * s)
    return ball(_spot(figure, posed, *at), posed.frames["head"], sized, blend=blend * s, carve=carve)


def _skull(figure: Figure, posed: Posed) -> list[Floats]:
    """Neck, cranium, jaw and cheeks."""
    s, neck = figure.head, 0.029 * figure.height * figure.girth
    broad = 1.0 + 0.06 * figure.beard
    return [
        cone(
            posed.at("chest", "Neck", -0.01, 0, -0.02),
            _spot(figure, posed, -0.018, 0, -0.035),
            (neck * 1.08, neck),
            blend=0.03,
        ),
        _lump(figure, posed, (-0.012, 0, 0.036), (0.098, 0.077, 0.086), 0.02),
        _lump(figure, posed, (0.032, 0, -0.022), (0.064, 0.062, 0.082), 0.03),
        _lump(figure, posed, (0.046, 0, -0.074), (0.040, 0.044 * broad, 0.032), 0.03),
        _lump(figure, posed, (0.078, 0, -0.094), (0.018, 0.020 * broad, 0.017), 0.025),
        *[_lump(figure, posed, (0.064, y * 0.043, -0.020), (0.021, 0.020, 0.020), 0.03) for y in SIDES],
        cone(
            _spot(figure, posed, 0.086, -0.034, 0.024),
            _spot(figure, posed, 0.086, 0.034, 0.024),
            (0.012 * s, 0.012 * s),
            blend=0.02,
        ),
    ]


def _features(figure: Figure, posed: Posed) -> list[Floats]:
    """Eyes in their sockets, nose, mouth and ears."""
    s = figure.head
    nose = (_spot(figure, posed, 0.093, 0, 0.014), _spot(figure, posed, 0.117, 0, -0.030))
    return [
        *[_lump(figure, posed, (0.103, y * 0.031, 0.003), (0.016, 0.017, 0.011), 0.010, carve=True) for y in SIDES],
        *[_lump(figure, posed, (0.080, y * 0.031, 0.002), (0.0125, 0.0125, 0.0115), 0.004) for y in SIDES],
        cone(*nose, (0.008 * s, 0.0125 * s), blend=0.012),
        *[_lump(figure, posed, (0.104, y * 0.013, -0.035), (0.009, 0.008, 0.008), 0.008) for y in SIDES],
        _lump(figure, posed, (0.091, 0, -0.058), (0.010, 0.024, 0.0065), 0.006),
        _lump(figure, posed, (0.089, 0, -0.071), (0.010, 0.020, 0.0070), 0.006),
        *[_lump(figure, posed, (-0.006, y * 0.078, -0.006), (0.015, 0.010, 0.031), 0.006) for y in SIDES],
    ]


def _ponytail(figure: Figure, posed: Posed) -> list[Floats]:
    """Hair drawn back, its tail hanging from a band behind the head."""
    s, band = figure.head, _spot(figure, posed, -0.118, 0, 0.052)
    hang = unit(posed.stance.tail)
    back = posed.frames["head"] @ vec(-1, 0, 0)
    bow = band + unit(hang + 0.9 * back) * 0.055 * s
    middle = bow + unit(hang + 0.15 * back) * 0.10 * s
    end = middle + hang * 0.11 * s
    return [
        _lump(figure, posed, (-0.030, 0, 0.052), (0.106, 0.088, 0.090), 0.004),
        _lump(figure, posed, (-0.060, 0, 0.000), (0.060, 0.080, 0.062), 0.010),
        *[_lump(figure, posed, (0.008, y * 0.014, 0.108), (0.060, 0.046, 0.028), 0.030) for y in SIDES],
        cone(_spot(figure, posed, -0.095, 0, 0.05), band, (0.030 * s, 0.022 * s), blend=0.02),
        cone(band, bow, (0.022 * s, 0.029 * s), blend=0.012),
        cone(bow, middle, (0.029 * s, 0.028 * s), blend=0.012),
        cone(middle, end, (0.028 * s, 0.012 * s), blend=0.012),
    ]


def _cropped(figure: Figure, posed: Posed) -> list[Floats]:
    """Short hair with a parting of sorts, and a beard."""
    return [
        _lump(figure, posed, (-0.022, 0, 0.050), (0.104, 0.084, 0.086), 0.006),
        _lump(figure, posed, (0.036, 0.010, 0.106), (0.050, 0.058, 0.022), 0.020),
        _lump(figure, posed, (-0.080, 0, -0.010), (0.036, 0.062, 0.062), 0.015),
        _lump(figure, posed, (0.056, 0, -0.096), (0.044, 0.047, 0.026), 0.010),
        _lump(figure, posed, (0.086, 0, -0.100), (0.018, 0.023, 0.026), 0.010),
        _lump(figure, posed, (0.094, 0, -0.046), (0.011, 0.027, 0.006), 0.006),
    ]
