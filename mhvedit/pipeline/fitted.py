"""Fitted skeletons, kept between runs: of the frames of a capture that a scene shows."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from mhvedit.fitting.capture import CaptureFit, fit_capture
from mhvedit.fitting.quality import FrameFit, Likeness, jumps, refusals
from mhvedit.fitting.template import Template
from mhvedit.geometry.arrays import IntArray
from mhvedit.pipeline.keys import frames_key
from mhvedit.pipeline.store import Arrays, Store
from mhvedit.sequences.meshes import MeshSequence

VERSION: Final = 1  # of what is kept; raise it when fits change
_ARRAYS: Final = ("vertices", "normals", "faces", "weights", "rest", "axes", "samples")  # of a template


def kept_fit(
    sequence: MeshSequence, numbers: IntArray, store: Store, *, axes: Sequence[str], workers: int
) -> CaptureFit:
    """The skeleton of a capture in some frames.

    Args:
        sequence: the capture.
        numbers: frames, ascending.
        store: where fits are kept between runs.
        axes: units and up axis of the capture on disk.
        workers: threads; the result does not depend on it.
    """
    some = replace(sequence, numbers=tuple(numbers.tolist()))
    key = ("fit", VERSION, frames_key(sequence, numbers, store.contents), sequence.fps, tuple(axes))
    return _fit_of(store.arrays(key, lambda: _as_arrays(fit_capture(some, workers=workers))))


def why_refused(fit: CaptureFit, numbers: IntArray, *, fps: float) -> tuple[str, ...]:
    """Why a fit may not be used in some of its frames, in sentences; nothing if it may.

    Args:
        fit: of a capture.
        numbers: of the frames that are to be edited.
        fps: Hz, of the capture.
    """
    rows = np.flatnonzero(np.isin(fit.numbers, numbers)).tolist()
    used = fit.numbers[rows].tolist()
    why = refusals(fit.likeness, used, [fit.frames[row] for row in rows])
    return why + jumps(used, fit.places[rows], fps=fps)


def _as_arrays(fit: CaptureFit) -> Arrays:
    template = {name: getattr(fit.template, name) for name in _ARRAYS}
    return template | {
        "bound": np.array(fit.template.number),
        "numbers": fit.numbers,
        "rotations": fit.rotations,
        "places": fit.places,
        "measured": np.array([[getattr(frame, own.name) for own in fields(FrameFit)] for frame in fit.frames]),
        "misfit": np.array(fit.likeness.misfit),
        "shares": fit.likeness.shares,
    }


def _fit_of(kept: Arrays) -> CaptureFit:
    return CaptureFit(
        kept["numbers"],
        Template(number=int(kept["bound"]), **{name: kept[name] for name in _ARRAYS}),
        kept["rotations"],
        kept["places"],
        tuple(FrameFit(*row) for row in kept["measured"].tolist()),
        Likeness(float(kept["misfit"]), kept["shares"]),
    )
