"""Measure avoidance on the shared motions and write the tables of docs/avoidance_results.md.

    python -m benchmarks.avoidance [--motions NAME ...] [--methods METHOD ...] [-o docs/avoidance_results.md]
    python -m benchmarks.avoidance --kernels

Times are those of one run on one machine; ratios within it say more than the numbers.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from benchmarks.process import run
from mhvedit.avoidance.kalman import Effectors, FilterSettings, resolve, resolve_effectors
from mhvedit.avoidance.methods import Avoided, Problem
from mhvedit.avoidance.metrics import Metrics, measure
from mhvedit.avoidance.posture import place, predict_posture
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.avoid import Method, avoid_collisions, avoidance_problem
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.skin import read_skinned, write_skinned
from tests.avoidance.figures import crossed_arms, figure, spheres
from tests.avoidance.scenes import (
    armed,
    grip_gap,
    jump,
    plain_body,
    problem_of,
    rise,
    walk,
    with_sphere,
    with_vest,
)
from tests.collision import independent

ROOT = Path(__file__).resolve().parents[1]
MOTIONS = ROOT.parent / "shared" / "data" / "motions"
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # more only wait for each other at this size
KERNELS = "All on one thread, NumPy's and SciPy's linear algebra too.\n\n"
SCENES = "By bisection, on a figure of 55 degrees of freedom in capsules.\n\n"
HEAD = """# Avoidance, measured

Made by `python -m benchmarks.avoidance`; how it works is told in [avoid](avoid.md).

- *colliding*: frames in which a pair of limbs is more than 4 mm deeper in each other than at rest (a collision is 5 mm:
  the last millimetre is for other ways to measure).
- *deepest*: deepest pair beyond rest, before and after, by our own measure.
- *judge*: the same after, by code that shares nothing with the package (`tests/collision/independent.py`: numpy and
  trimesh), in every twentieth frame and in the ten that are deepest by our measure.
- *effort*: mean of the sum of gamma times the squared change (Degenhardt, eq. 2.5). *change*: root mean square and
  largest, of all turning degrees of freedom in all frames.
- *step*: largest turn of a joint between two frames, in the world or in its parent, over the captured one; *jerk*: root
  mean square third difference, over the captured one; *slip*: the most that a foot that stood still moved.
- *ms*: time a frame of the motion, all frames counted, processor time of the whole method on one thread.

Nebel's method interpolates between key frames and keeps nothing of the captured motion between them, so its feet slide;
it is here as the baseline. Times are those of one run on one machine; ratios within it say more than the numbers.

"""


@dataclass(frozen=True, slots=True)
class Row:
    """One motion by one method."""

    motion: str
    method: Method
    converged: bool
    numbers: Metrics
    judged_mm: float | None  # deepest beyond rest by the independent check
    seconds: float


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", nargs="*", default=sorted(path.stem for path in MOTIONS.glob("*.npz")))
    parser.add_argument("--methods", nargs="*", default=[method.value for method in Method])
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "docs" / "avoidance_results.md")
    parser.add_argument("--kernels", action="store_true", help="print the table of one frame, and no more")
    chosen = parser.parse_args()
    if chosen.kernels:
        print(kernel_table(), end="")
        return
    scenes = motion_table([run_scene(name, problem) for name, problem in thesis_scenes()])
    rest = "\n## The thesis's scenes\n" + SCENES + scenes + "\n" + weapon_gaps()
    rest += "\n## One frame, beside other libraries\n" + KERNELS
    rest += run(sys.executable, "-m", "benchmarks.avoidance", "--kernels", env=ONE_THREAD).output
    rows = list[Row]()
    for method in chosen.methods:
        for name in chosen.motions:
            rows.append(run_motion(name, Method(method)))
            text = HEAD + "## Captured motions\n" + motion_table(sorted(rows, key=lambda row: row.motion)) + rest
            chosen.out.write_text(text, encoding="utf-8")  # what is known so far: the whole takes a while


def run_motion(name: str, method: Method) -> Row:
    """One captured motion by one method."""
    path = MOTIONS / f"{name}.npz"
    skinned = read_skinned(path)
    problem, _ = avoidance_problem(skinned.body, skinned.motion, workers=1)
    row, avoided = solve(name, problem, method)
    with tempfile.TemporaryDirectory() as folder:
        write_skinned(Path(folder) / "edited.npz", skinned, avoided.motion)
        frames = {*range(0, skinned.motion.n_frames, 20), *np.argsort(-avoided.after)[:10].tolist()}
        return replace(row, judged_mm=1000 * judged(path, Path(folder) / "edited.npz", sorted(frames)))


def run_scene(name: str, problem: Problem) -> Row:
    """One of the thesis's scenes by bisection."""
    return solve(name, problem, Method.BISECTION)[0]


def solve(name: str, problem: Problem, method: Method) -> tuple[Row, Avoided]:
    """Any problem by one method, once its functions are compiled or read from the cache."""
    problem.body.guard.look(problem.captured.q[0])
    started = time.process_time()
    avoided = avoid_collisions(problem, method)
    seconds = time.process_time() - started
    print(f"{name} {method}: {seconds:.1f} s, converged {avoided.converged}", flush=True)
    return Row(name, method, avoided.converged, measure(problem, avoided), None, seconds), avoided


def judged(captured: Path, edited: Path, frames: Sequence[int]) -> float:
    """Deepest pair beyond rest in some frames, m, by the independent check."""
    before, after = dict(np.load(captured)), dict(np.load(edited))
    pieces = independent.cut(before)
    rest = independent.rest_depths(before, pieces)
    return max(float((independent.depths(pieces, independent.posed(after, frame)) - rest).max()) for frame in frames)


def thesis_scenes() -> list[tuple[str, Problem]]:
    """The scenes of Degenhardt's chapter 4, on a figure of capsules."""
    body, legs = plain_body(), ("hips", "left_thigh", "left_shin", "right_thigh", "right_shin")
    on_chest = with_sphere(body, at=(0.18, -0.2, 1.12), radius=0.06, limb="spine0")
    on_hips = with_sphere(body, at=(0.2, -0.25, 1.0), radius=0.05, limb="hips")
    held, weapon = armed()
    return [
        ("walk, sphere on the torso", problem_of(on_chest, walk())),
        ("jump, sphere on the hips", problem_of(on_hips, jump())),
        ("jump, vest on both sides", problem_of(with_vest(body), jump())),
        ("walk with a weapon, hand free", held),
        ("walk with a weapon, hand held", replace(held, tasks=(*held.tasks, weapon))),
        ("prone to standing, all joints", problem_of(body, rise())),
        ("prone to standing, lower body frozen", problem_of(body, rise(), frozen=legs)),
    ]


def weapon_gaps() -> str:
    """How far the second hand comes off the weapon (figures 4.4 and 4.5)."""
    held, weapon = armed()
    gaps = []
    for tasks in (held.tasks, (*held.tasks, weapon)):
        avoided = avoid_collisions(replace(held, tasks=tasks), Method.BISECTION)
        gaps.append(1000 * grip_gap(held.body.skeleton, weapon, avoided.motion.q))
    return (
        f"The second hand comes off the weapon by {gaps[0]:.1f} mm where it is free, "
        f"and by {gaps[1]:.2f} mm where it is held.\n"
    )


def motion_table(rows: Sequence[Row]) -> str:
    """All motions by all methods."""
    text = (
        "| motion | method | converged | colliding | deepest, mm | judge, mm | effort | change, rad | touched | step | "
        "jerk | slip, mm | solved | ms |\n|" + "---|" * 14 + "\n"
    )
    for row in rows:
        m, judge = row.numbers, "" if row.judged_mm is None else f"{row.judged_mm:.1f}"
        text += (
            f"| {row.motion} | {row.method.value} | {'yes' if row.converged else 'no'} | "
            f"{m.colliding_before} → {m.colliding_after} of {m.frames} | "
            f"{m.deepest_before_mm:.1f} → {m.deepest_after_mm:.1f} | {judge} | "
            f"{m.effort:.4f} | {m.change_rms:.4f} / {m.change_max:.2f} | {m.touched} | {m.step_ratio:.2f} | "
            f"{m.jerk_ratio:.2f} | {m.slip_mm:.1f} | {m.solved} | {1000 * row.seconds / m.frames:.0f} |\n"
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
