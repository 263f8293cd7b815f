"""Motion between keys: smooth for the body, sharp where blades strike, feet planted or stepping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from .vectors import Floats, smoothstep, vec

FINE = 4  # samples a frame while smoothing

Row = tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A curve through keys; at the times in `breaks` it may change speed abruptly."""

    times: Floats
    values: Floats
    breaks: tuple[float, ...]

    def at(self, time: float) -> Floats:
        """Value at a time in frames; held before the first key and after the last."""
        edges = [float(self.times[0]), *self.breaks, float(self.times[-1])]
        time = float(np.clip(time, edges[0], edges[-1]))
        run = min(int(np.searchsorted(edges, time, side="right")) - 1, len(edges) - 2)
        low, high = edges[run], edges[run + 1]
        inside = (self.times >= low) & (self.times <= high)
        return np.asarray(PchipInterpolator(self.times[inside], self.values[inside])(time))


def track(rows: tuple[Row, ...], breaks: tuple[float, ...] = ()) -> Track:
    """Keys as rows of (frame, values ...)."""
    table = np.array(rows, dtype=np.float64)
    return Track(table[:, 0], table[:, 1:], breaks)


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A track sampled finely and smoothed, so that acceleration is continuous too."""

    start: float
    samples: Floats

    def at(self, time: float) -> Floats:
        """Value at a time in frames."""
        place = float(np.clip((time - self.start) * FINE, 0.0, len(self.samples) - 1.001))
        low = int(place)
        return np.asarray(self.samples[low] + (place - low) * (self.samples[low + 1] - self.samples[low]))


def curve(rows: tuple[Row, ...], smooth: float = 2.0) -> Curve:
    """Keys as rows of (frame, values ...), smoothed over `smooth` frames."""
    keys = track(rows)
    times = np.arange(keys.times[0], keys.times[-1] + 1.0 / FINE, 1.0 / FINE)
    sampled = PchipInterpolator(keys.times, keys.values)(np.minimum(times, keys.times[-1]))
    return Curve(float(keys.times[0]), np.asarray(gaussian_filter1d(sampled, smooth * FINE, axis=0, mode="nearest")))


@dataclass(frozen=True, slots=True)
class Step:
    """One step: from `lift` to `land` (frames) to a place and a direction."""

    lift: float
    land: float
    x: float  # m
    y: float  # m
    yaw: float  # rad
    height: float = 0.07  # m


def foot_at(first: tuple[float, float, float], steps: tuple[Step, ...], time: float) -> tuple[Floats, float, float]:
    """Sole (3,) m, yaw and pitch (rad) of a foot that only moves while it is off the floor."""
    place, yaw = vec(first[0], first[1], 0.0), first[2]
    for step in steps:
        if time <= step.lift:
            break
        u = (time - step.lift) / (step.land - step.lift)
        goal = vec(step.x, step.y, 0.0)
        if u >= 1.0:
            place, yaw = goal, step.yaw
            continue
        go = smoothstep(u)
        ahead = float(np.sign((goal - place) @ vec(np.cos(step.yaw), np.sin(step.yaw), 0.0)))
        place = place + (goal - place) * go
        place = place + vec(0, 0, step.height * np.sin(np.pi * smoothstep(u) ** 0.9) ** 2)
        pitch = 0.30 * ahead * np.sin(2.0 * np.pi * u) * np.sin(np.pi * u)
        return place, yaw + (step.yaw - yaw) * go, float(pitch)
    return place, yaw, 0.0
