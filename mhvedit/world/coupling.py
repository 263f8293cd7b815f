"""Virtual coupling: a spring and a damper between a tracker and the body that it drives (Schmidl and Lin, eq. 6)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.problems import WorldError


@dataclass(frozen=True, slots=True)
class Coupling:
    """Spring and damper; the paper's values are critically damped for a body of R^2 / 4 K = 0.4 kg."""

    stiffness: float = 1000.0  # K, N/m
    damping: float = 40.0  # R, N s/m

    def __post_init__(self) -> None:
        if not (0.0 < self.stiffness < np.inf and 0.0 <= self.damping < np.inf):
            raise WorldError("coupling", "a positive stiffness and a damping of at least 0", self)


def coupled(
    offset: FloatArray, velocity: FloatArray, *, mass: float, time: float, coupling: Coupling
) -> tuple[FloatArray, FloatArray]:
    """Where m x'' = -K x - R x' brings an offset after a time: exact, for any mass and time.

    Args:
        offset: (3,) m, of the body from the tracker's pose (not from the origin: eq. 6 as it has to be read).
        velocity: (3,) m/s, of the body relative to the tracker.
        mass: kg.
        time: s, at least 0.
        coupling: K and R.

    Returns:
        Offset and relative velocity at the end.

    Raises:
        WorldError: a mass that is not positive, or a time that is negative.
    """
    if not 0.0 < mass < np.inf:
        raise WorldError("mass of a driven body", "a number above 0 kg", mass)
    if not 0.0 <= time < np.inf:
        raise WorldError("time of a coupling", "at least 0 s", time)
    half, stiff = coupling.damping / (2 * mass), coupling.stiffness / mass
    root = np.sqrt(complex(half * half - stiff))
    slow, fast = np.exp((root - half) * time), np.exp((-root - half) * time)
    even = float(((slow + fast) / 2).real)
    # sinh(root t) / root, times the decay; its limit where the damping is critical
    odd = float(((slow - fast) / (2 * root)).real) if abs(root) * time > 1e-6 else time * float(np.exp(-half * time))
    after = (even + half * odd) * offset + odd * velocity
    return np.asarray(after), np.asarray(-stiff * odd * offset + (even - half * odd) * velocity)
