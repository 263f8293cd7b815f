"""The best chain of placements over all key segments, globally, with a proof (Shi et al., eqs 16 to 18).

Positions eliminate in closed form: with e = d - D, the change of the vector from A's root to B's root, positions cost
the sum of 1/2 |e' - e|^2 over consecutive roots. B's capture frame is turned by a free angle, the gauge, since
the captures' world frames are unrelated; only differences of e count, so its shift drops out. A constant relative pose
that every segment accepts costs nothing, and is looked for first; ties are broken by merit, then by the smallest pose.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.branching import best_and_rivals
from mhvedit.optimise.chains import Chain, Start, stage_costs
from mhvedit.optimise.stages import Stage, common_codes, pose_codes, some_of
from mhvedit.optimise.thinning import near_best, places_of
from mhvedit.optimise.ties import deepest_chain


@dataclass(frozen=True, slots=True, eq=False)
class KeyPlacements:
    """The chosen solution of every stage, and where the pair stands in the world; canonical frames throughout."""

    chosen: IntArray  # (G,) row of each stage
    a: FloatArray  # (G, 3) x, y m and yaw rad: world_from_a
    b: FloatArray  # (G, 3) world_from_b
    gauge: float  # rad, turn of B's frame against A's in which B's motion is kept
    cost: float  # m^2
    lower_bound: float  # m^2
    equals: int  # constant poses that cost nothing, among which merit decided (1 where there are none)


def best_placements(
    stages: Sequence[Stage], *, facing_weight: float, step: float, n_yaw: int, start: Start | None = None
) -> KeyPlacements:
    """Choose a solution per stage and where the pair stands (Shi et al., eqs 16 to 18).

    Args:
        stages: in order, at least one, none empty.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        start: what `near_best` starts from, where the stages hold no more than it leaves of them.
    """
    codes = [pose_codes(stage.keys) for stage in stages]
    common = common_codes(codes)
    if len(common):
        rows = [np.searchsorted(own, common) for own in codes]
        merit = np.min([stage.merit[row] for stage, row in zip(stages, rows, strict=True)], axis=0)
        best = int(np.argmax(merit))
        chosen = np.array([row[best] for row in rows])
        gauge = float(stages[0].poses[chosen[0], 2])
        return _placed(stages, Chain(chosen, np.zeros(len(stages)), gauge, 0.0, 0.0), equals=len(common))
    near = [np.arange(len(stage)) for stage in stages]
    if start is None:
        found = near_best([places_of(stage) for stage in stages], facing_weight=facing_weight, step=step, n_yaw=n_yaw)
        near, start = found.rows, found.start
    thin = [some_of(stage, rows) for stage, rows in zip(stages, near, strict=True)]
    costs = stage_costs(thin, facing_weight=facing_weight)
    chain, rivals = best_and_rivals(costs, step=step, n_yaw=n_yaw, start=start)
    chosen = np.array([np.searchsorted(own, row) for own, row in zip(rivals, chain.chosen, strict=True)])
    few = [some_of(stage, rows) for stage, rows in zip(thin, rivals, strict=True)]
    costs = stage_costs(few, facing_weight=facing_weight)
    chain = deepest_chain(costs, [stage.merit for stage in few], replace(chain, chosen=chosen), n_yaw=n_yaw)
    chosen = np.array([rows[own[row]] for rows, own, row in zip(near, rivals, chain.chosen, strict=True)])
    return _placed(stages, replace(chain, chosen=chosen), equals=1)


def _placed(stages: Sequence[Stage], chain: Chain, *, equals: int) -> KeyPlacements:
    """Where the pair stands: A stays in place in the first stage, every step splits the change of e evenly."""
    a, b = np.empty((len(stages), 3)), np.empty((len(stages), 3))
    last_a = last_b = None
    for g, stage in enumerate(stages):
        pose, turn = stage.poses[chain.chosen[g]], chain.turns[g]
        root_a, root_b = stage.roots_a, stage.roots_b
        turned_a = root_a @ _turn(turn)
        turned_b = root_b @ _turn(turn + pose[2]) + pose[:2] @ _turn(turn)
        if last_a is None or last_b is None:
            shift = root_a.mean(0) - turned_a.mean(0)
        else:
            step_a = root_a[0] - stages[g - 1].roots_a[-1]
            step_b = (root_b[0] - stages[g - 1].roots_b[-1]) @ _turn(chain.gauge)
            shift = 0.5 * ((last_a + step_a - turned_a[0]) + (last_b + step_b - turned_b[0]))
        a[g] = *shift, turn
        b[g] = *(pose[:2] @ _turn(turn) + shift), turn + pose[2]
        last_a, last_b = turned_a[-1] + shift, turned_b[-1] + shift
    return KeyPlacements(chain.chosen, a, b, chain.gauge, chain.cost, chain.lower_bound, equals)


def _turn(yaw: float) -> FloatArray:
    """The matrix that turns row vectors by yaw."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, s], [-s, c]])
