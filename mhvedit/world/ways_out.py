"""Three ways out of an overlap: descent along chains, damped least squares, and the nearest posture without overlap."""

from typing import Final

import numpy as np

from mhvedit.avoidance.posture import PostureSettings, predict_posture
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.cones import InCone
from mhvedit.world.depth import LEEWAY, TOLERANCE, global_depth, normals_cancel
from mhvedit.world.descent import DescentSettings, Effector, descend
from mhvedit.world.figure import Figure, inward_dofs
from mhvedit.world.surroundings import Frames, PieceGaps, Seen, Surroundings, gap_rows

PARALLEL: Final = np.radians(10.0)  # rad: a limb this near to the surface is translated (C3.6)
DAMPING: Final = 0.02  # m
TRUST: Final = 0.3  # rad or m, largest step of a DOF
MARGIN: Final = 1e-3  # m, that posture prediction keeps
REACH: Final = 0.03  # m beyond the margin, how far it looks
PREDICTIONS: Final = 12  # quadratic programmes of one prediction
_DESCENT: Final = DescentSettings()


def descended(seen: Seen, figure: Figure, rng: np.random.Generator) -> FloatArray:
    """(D,) after one pass over all chains in random order: in each, the link nearest to the root (C3.1)."""
    q = seen.placed.q.copy()
    links = np.unique(seen.joints[seen.gaps.distance < -TOLERANCE / 2])
    links = links[links >= 0]
    chains = figure.chain[links]
    for chain in rng.permutation(np.unique(chains)):
        q = _link_moved(seen, figure, q, int(links[chains == chain][0]))
    return q


def squared(seen: Seen, figure: Figure) -> FloatArray:
    """(D,) after a step against all overlaps at once: dq = W J^T (J W J^T + damping^2)^-1 depth, W = 1 / effort."""
    q, limits = seen.placed.q, figure.skeleton.limits
    which = np.flatnonzero(seen.gaps.distance < 0)
    depth = LEEWAY + TOLERANCE - seen.gaps.distance[which]
    rows = gap_rows(seen, which)
    free, step = np.ones(len(q), np.bool_), np.zeros(len(q))
    for _ in range(2):  # again without those DOFs that the first would take beyond their limits
        weighted = np.where(free, 1.0 / figure.effort, 0.0) * rows
        step = weighted.T @ np.linalg.solve(rows @ weighted.T + DAMPING**2 * np.eye(len(rows)), depth)
        free &= (q + step >= limits[:, 0]) & (q + step <= limits[:, 1])
    return q + np.clip(step, -TRUST, TRUST)


def predicted(
    surroundings: Surroundings, frames: Frames, tracked: FloatArray, *, start: FloatArray, limits: FloatArray
) -> tuple[FloatArray, int]:
    """The posture nearest to the tracked one without overlap, by sequential quadratic programming.

    Args:
        surroundings: the figure and the bodies.
        frames: where the bodies are.
        tracked: (D,) rad or m.
        start: (D,) where the search begins; it decides on which side limbs pass.
        limits: (D, 2) rad or m.

    Returns:
        (D,) the posture and how many programmes were solved.
    """
    figure = surroundings.figure
    found = predict_posture(
        figure.skeleton,
        tracked,
        (PieceGaps(surroundings, frames, MARGIN, REACH), *(InCone(cone) for cone in figure.cones)),
        start=start,
        weights=figure.effort,
        limits=limits,
        settings=PostureSettings(tolerance=TOLERANCE, trust=TRUST, iterations=PREDICTIONS),
    )
    return found.q, found.iterations


def _link_moved(seen: Seen, figure: Figure, q: FloatArray, link: int) -> FloatArray:
    """One link goes by its global penetration depth: by descent, or for the trunk by translation."""
    way, middle = _way_out(seen, link)
    if way is None:
        return q
    skeleton, dofs = figure.skeleton, inward_dofs(figure, link)
    if not len(dofs):
        return _translated(figure, q, way)
    turn, at = seen.placed.rotations[link], seen.placed.positions[link]
    effector = Effector(link, turn.T @ (middle - at), middle + way)
    own = skeleton.dof_joint[dofs] == link
    if own.all() or not _is_parallel(seen, link, way):
        return descend(skeleton, q, effector, dofs, settings=_DESCENT).q
    reconnected = Effector(int(skeleton.parents[link]), skeleton.offsets[link], at + way)
    q = descend(skeleton, q, reconnected, dofs[~own], settings=_DESCENT).q
    return descend(skeleton, q, effector, dofs[own], settings=_DESCENT).q


def _way_out(seen: Seen, link: int) -> tuple[FloatArray | None, FloatArray]:
    """Its share of PD_g of a link against all that it overlaps, and the middle of its contacts (eqs 1 to 3)."""
    gaps = seen.gaps
    mine = np.flatnonzero((seen.joints == link).any(1) & (gaps.distance < 0))
    first = seen.joints[mine, 0] == link
    share = np.where((seen.joints[mine] >= 0).all(1), 0.5, 1.0)  # another limb gives way as well
    normals = gaps.normal[mine] * np.where(first, 1.0, -1.0)[:, None]
    depths = LEEWAY - gaps.distance[mine]
    middle = np.where(first[:, None], gaps.at_a[mine], gaps.at_b[mine]).mean(0)
    if normals_cancel(depths, normals):
        return None, middle
    return global_depth(depths, normals) * float(share.max()), middle


def _is_parallel(seen: Seen, link: int, way: FloatArray) -> bool:
    """Whether a link lies nearly along the surface that it is to leave."""
    children = np.flatnonzero(seen.placed.skeleton.parents == link)
    if not len(children):
        return False
    along = seen.placed.positions[children[0]] - seen.placed.positions[link]
    sine = abs(along @ way) / max(float(np.linalg.norm(along) * np.linalg.norm(way)), 1e-12)
    return bool(sine < np.sin(PARALLEL))


def _translated(figure: Figure, q: FloatArray, way: FloatArray) -> FloatArray:
    """The posture with its root moved; the root's slides are along the world's axes."""
    skeleton = figure.skeleton
    slides: IntArray = np.flatnonzero(skeleton.dof_slides & (skeleton.dof_joint == 0))
    moved = q.copy()
    moved[slides] += skeleton.dof_axis[slides] @ way
    return moved
