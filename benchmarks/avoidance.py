"""Measure avoidance on the shared motions and write the tables of docs/avoidance_results.md.

    python benchmarks/avoidance.py [--motions NAME ...] [--methods METHOD ...] [-o docs/avoidance_results.md]

Times are those of one run on one machine; ratios within it say more than the numbers.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from mhvedit.avoidance.kalman import Effectors, FilterSettings, resolve, resolve_effectors
from mhvedit.avoidance.methods import Avoided
from mhvedit.avoidance.metrics import Metrics, measure
from mhvedit.avoidance.posture import place, predict_posture
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.avoid import METHODS, Method, avoidance_problem
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.skin import read_skinned
from tests.avoidance.figures import crossed_arms, figure, spheres

ROOT = Path(__file__).resolve().parents[1]
MOTIONS = ROOT.parent / "shared" / "data" / "motions"
HEAD = """# Avoidance, measured

Made by `benchmarks/avoidance.py`. *Excess* is how much deeper than at rest and 4 mm the deepest pair of limbs is (a
collision is 5 mm deeper than at rest); *step* and *jerk* are ratios to the
captured motion; *slip* is what feet that stood still moved; *ms* is the time a frame of the motion, all frames counted.
Nebel's method interpolates between key frames and keeps nothing of the captured motion between them, so its feet slide;
it is here as the baseline.

"""


@dataclass(frozen=True, slots=True)
class Row:
    """One motion by one method."""

    motion: str
    method: Method
    converged: bool
    numbers: Metrics
    seconds: float


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", nargs="*", default=sorted(path.stem for path in MOTIONS.glob("*.npz")))
    parser.add_argument("--methods", nargs="*", default=[method.value for method in Method])
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "docs" / "avoidance_results.md")
    chosen = parser.parse_args()
    rows = [run(name, Method(method)) for name in chosen.motions for method in chosen.methods]
    chosen.out.write_text(HEAD + motion_table(rows) + "\n" + kernel_table(), encoding="utf-8")


def run(name: str, method: Method) -> Row:
    """One motion by one method, the second time that its functions run."""
    skinned = read_skinned(MOTIONS / f"{name}.npz")
    problem, _ = avoidance_problem(skinned.body, skinned.motion)
    problem.body.guard.look(problem.captured.q[0])  # compiled, or read from the cache
    started = time.perf_counter()
    avoided: Avoided = METHODS[method](problem)
    seconds = time.perf_counter() - started
    print(f"{name} {method}: {seconds:.1f} s, converged {avoided.converged}", flush=True)
    return Row(name, method, avoided.converged, measure(problem, avoided), seconds)


def motion_table(rows: Sequence[Row]) -> str:
    """All motions by all methods."""
    text = (
        "| motion | method | converged | colliding frames | excess, mm | effort | joint change rms / max, rad | "
        "touched | step | jerk | slip, mm | frames solved | ms |\n|" + "---|" * 13 + "\n"
    )
    for row in rows:
        m = row.numbers
        text += (
            f"| {row.motion} | {row.method.value} | {'yes' if row.converged else 'no'} | "
            f"{m.colliding_before} → {m.colliding_after} of {m.frames} | "
            f"{m.excess_before_mm:.1f} → {m.excess_after_mm:.1f} | "
            f"{m.effort:.3f} | {m.change_rms:.4f} / {m.change_max:.2f} | {m.touched} | {m.step_ratio:.2f} | "
            f"{m.jerk_ratio:.2f} | {m.slip_mm:.1f} | {m.solved} | {1000 * row.seconds / m.frames:.1f} |\n"
        )
    return text


def kernel_table() -> str:
    """One frame by the filter and by posture prediction, beside what others do."""
    text = "| what | median ms | 95 % ms | solved | left, mm |\n|---|---|---|---|---|\n"
    for name, cases, solve in (*filter_cases(), *posture_cases()):
        times, left, good = [], [], []
        solve(cases[0])
        for case in cases:
            started = time.perf_counter()
            residual, ok = solve(case)
            times.append(1000 * (time.perf_counter() - started))
            left.append(1000 * residual)
            good.append(ok)
        text += (
            f"| {name} | {np.median(times):.3f} | {np.percentile(times, 95):.3f} | "
            f"{sum(good)} of {len(good)} | {np.median(left):.4f} |\n"
        )
    return text


Cases = tuple[str, list[Any], Callable[[Any], tuple[float, bool]]]


def filter_cases() -> list[Cases]:
    """One hand of the 55-DOF figure to a place 10 cm away."""
    skeleton = figure()
    hand = Effectors(np.array([skeleton.names.index("left_hand")]), np.zeros((1, 3)))
    q = crossed_arms(skeleton, 60)
    shift = np.random.default_rng(0).normal(0, 0.06, (60, 1, 3))
    cases = list(zip(q, points_on_joints(skeleton, q, hand.joints, hand.points) + shift, strict=True))
    variances = np.full(skeleton.n_dofs, 1e-2)

    def compiled(case: tuple[FloatArray, FloatArray]) -> tuple[float, bool]:
        settings = FilterSettings(iterations=3, tolerance=0.0)
        found = resolve_effectors(
            skeleton, case[0][None], variances, effectors=hand, targets=case[1][None], settings=settings
        )
        return float(found.residuals[0]), bool(found.residuals[0] < 1e-3)

    def plain(case: tuple[FloatArray, FloatArray]) -> tuple[float, bool]:
        found = resolve(
            lambda x: points_on_joints(skeleton, x, hand.joints, hand.points).ravel(),
            case[0],
            variances,
            target=case[1].ravel(),
            limits=skeleton.limits,
            settings=FilterSettings(iterations=3, tolerance=0.0),
        )
        return float(found.residuals[0]), bool(found.residuals[0] < 1e-3)

    return [
        ("filter, 3 updates, compiled", cases, compiled),
        ("filter, 3 updates, any f", cases[:10], plain),
        ("filterpy, 1 update", cases[:10], filterpy_update),
    ]


def filterpy_update(case: tuple[FloatArray, FloatArray]) -> tuple[float, bool]:
    """The library's unscented filter on the same frame."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    skeleton = figure()
    joints, points = np.array([skeleton.names.index("left_hand")]), np.zeros((1, 3))

    def f(x: FloatArray) -> FloatArray:
        return points_on_joints(skeleton, x, joints, points).ravel()

    n = skeleton.n_dofs
    sigma = MerweScaledSigmaPoints(n, alpha=1.0, beta=2.0, kappa=0.0)
    ukf = UnscentedKalmanFilter(n, 3, 1.0, hx=f, fx=lambda x, _: x, points=sigma)
    ukf.x, ukf.P, ukf.R, ukf.Q = case[0].copy(), 1e-2 * np.eye(n), 1e-9 * np.eye(3), np.zeros((n, n))
    ukf.predict()
    ukf.update(case[1].ravel())
    residual = float(np.linalg.norm(f(ukf.x) - case[1].ravel()))
    return residual, residual < 1e-3


def posture_cases() -> list[Cases]:
    """Crossed arms of the figure, 43 spheres in five groups, all pairs of different groups."""
    skeleton = figure()
    gaps = spheres(skeleton)
    cases = [q for q in crossed_arms(skeleton, 80) if gaps.rows(place(skeleton, q)).violation > 5e-4][:40]

    def mine(q: FloatArray) -> tuple[float, bool]:
        found = predict_posture(skeleton, q, [gaps])
        return found.violation, found.converged

    def slsqp(q: FloatArray) -> tuple[float, bool]:
        near = spheres(skeleton)
        rows = near.rows(place(skeleton, q))
        found = minimize(
            lambda x: float(((x - q) ** 2).sum()),
            q,
            jac=lambda x: 2 * (x - q),
            method="SLSQP",
            constraints={"type": "ineq", "fun": lambda x: -_missing(x, len(rows.low))},
            options={"maxiter": 40},
        )
        violation = near.rows(place(skeleton, found.x)).violation
        return violation, violation < 5e-4

    def _missing(x: FloatArray, n: int) -> FloatArray:
        worst = np.sort(gaps.rows(place(skeleton, x)).low)[::-1]
        return np.concatenate([worst, np.full(max(n - len(worst), 0), -0.1)])[:n]

    name = f"posture, {skeleton.n_dofs} DOFs, {len(gaps.pairs)} pairs of spheres"
    return [(name, cases, mine), ("SLSQP, near pairs alone, 5 postures", cases[:5], slsqp)]


if __name__ == "__main__":
    main()
