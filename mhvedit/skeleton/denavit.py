"""The thesis's 55 degrees of freedom from Denavit-Hartenberg rows (Degenhardt, 2.1.1; B1)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.files import load_table
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.tables import PACKAGE


@dataclass(frozen=True, slots=True, eq=False)
class DhChain:
    """Rows one after the other; row i moves about or along the z axis of the frame before it."""

    after: str  # joint that carries the base; "" for the world
    base: FloatArray  # (4, 4) world_from_base where q = 0
    dofs: tuple[str, ...]  # n, "joint.axis"
    theta: FloatArray  # (n,) rad
    d: FloatArray  # (n,) m
    a: FloatArray  # (n,) m
    alpha: FloatArray  # (n,) rad
    slides: tuple[bool, ...]
    limits: FloatArray  # (n, 2) rad or m
    tip: str  # name of the point at the end; "" for none


def dh_chains() -> tuple[DhChain, ...]:
    """The table of the package."""
    return tuple(_chain(row) for row in load_table(PACKAGE, "denavit_hartenberg")["chains"])


def dh_transform(theta: float, d: float, a: float, alpha: float) -> FloatArray:
    """(4, 4) one row, from the frame before it to its own (equation 2.2)."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]])


def dh_frames(chain: DhChain, q: FloatArray) -> FloatArray:
    """(n + 1, 4, 4) base_from_row of a chain: the base itself, then after each row (equation 2.1).

    Args:
        chain: of the table.
        q: (n,) rad or m.
    """
    frames = [np.eye(4)]
    for i, slides in enumerate(chain.slides):
        turn, slide = (0.0, q[i]) if slides else (q[i], 0.0)
        frames.append(frames[-1] @ dh_transform(chain.theta[i] + turn, chain.d[i] + slide, chain.a[i], chain.alpha[i]))
    return np.stack(frames)


def dh_skeleton() -> Skeleton:
    """The table as a skeleton: rows whose axes meet in one point are one joint."""
    names, parents, positions = list[str](), list[int](), list[FloatArray]()
    rows: list[tuple[int, FloatArray, bool, FloatArray, str]] = []
    for chain in dh_chains():
        up = names.index(chain.after) if chain.after else -1
        frames = chain.base @ dh_frames(chain, np.zeros(len(chain.dofs)))
        joints = [dof.split(".")[0] for dof in chain.dofs]
        for i, joint in enumerate(joints):
            if joint not in names:
                names.append(joint)
                parents.append(up)
                positions.append(_meeting_point(frames[[k for k, name in enumerate(joints) if name == joint]]))
                up = len(names) - 1
            rows.append((up, frames[i, :3, 2], chain.slides[i], chain.limits[i], chain.dofs[i]))
        if chain.tip:
            names.append(chain.tip)
            parents.append(up)
            positions.append(frames[-1, :3, 3])
    at = np.array(positions)
    return Skeleton(
        tuple(names),
        np.array(parents),
        at - np.where(np.array(parents)[:, None] >= 0, at[parents], 0.0),
        np.array([joint for joint, *_ in rows]),
        np.array([axis / np.linalg.norm(axis) for _, axis, *_ in rows]),
        np.array([slides for _, _, slides, *_ in rows]),
        np.array([limits for *_, limits, _ in rows]),
        tuple(name for *_, name in rows),
    )


def _chain(row: dict[str, object]) -> DhChain:
    """One chain of the table."""
    table: list[dict[str, float]] = row["rows"]  # type: ignore[assignment]
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = np.array(row["rotation"]), np.array(row["point"])
    return DhChain(
        str(row["after"]),
        base,
        tuple(str(r["dof"]) for r in table),
        np.radians([r["theta"] for r in table]),
        np.array([r["d"] for r in table]),
        np.array([r["a"] for r in table]),
        np.radians([r["alpha"] for r in table]),
        tuple(bool(r.get("slides", False)) for r in table),
        np.array([np.radians(r["limits"]) if "limits" in r else (-np.inf, np.inf) for r in table]),
        str(row["tip"]),
    )


def _meeting_point(frames: FloatArray) -> FloatArray:
    """(3,) the point nearest to all z axes; of one axis, its frame's origin."""
    if len(frames) == 1:
        return np.asarray(frames[0, :3, 3])
    axes, points = frames[:, :3, 2], frames[:, :3, 3]
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    return np.asarray(np.linalg.lstsq(across.sum(0), (across @ points[..., None]).sum(0)[:, 0], rcond=None)[0])
