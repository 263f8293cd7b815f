"""Lays the template into frames, and finds from many frames where its joints are (F1, F2).

Articulated closest points: every sample of the template looks for the captured surface near it that faces its way, and
damped Gauss-Newton steps shorten the distances along its normals. From a set of frames at once the joints' places in
the bind frame follow as well, with all poses eliminated (Schur complement): a joint is where its bones turn.
"""

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from mhvedit.fitting.joints import LOOSE, MIRROR, NAMES, PARENTS, joint
from mhvedit.fitting.kernels import add_surface, chain_into, pose_into
from mhvedit.fitting.template import Template, carriers, outward_normals
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.meshes import Mesh

N_JOINTS: Final = len(NAMES)
HIPS: Final = [joint("left_thigh"), joint("right_thigh")]
N_POSE: Final = 3 + 3 * N_JOINTS  # unknowns of a pose; the joints' places come after them
NEIGHBOURS: Final = 5  # captured points that a sample chooses from
WRONG_WAY: Final = 0.06  # m, what a normal square to the sample's counts as
ALONG: Final = 0.1  # how much a distance along the surface counts against one across it
FROM_START: Final = np.array([0.1, 0.07, 0.05, 0.04, 0.04, 0.04, 0.04])  # m, beyond which a point loses its say
FROM_NEAR: Final = np.full(3, 0.04)  # m
DAMPING: Final = 1e-4  # m^2 / rad^2 and 1, of one step
PULL: Final = 2e-5  # m^2 / rad^2, of each joint to the bend that it starts with
LARGEST_TURN: Final = 0.35  # rad a step, each joint
SURFACE_SPREAD: Final = 0.004  # m, by which surfaces differ from bent bones, for the weight of the joints' priors
INDEPENDENT: Final = 80.0  # how much all frames of a set together weigh against the priors
UNLIKE: Final = 0.01  # m, standard deviation of the left joints' places from the right ones' mirrored


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """The template in one frame."""

    rotations: FloatArray  # (J, 3, 3) bind frame to posed frame
    pelvis: FloatArray  # (3,) m


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A captured surface that the template is laid into."""

    points: FloatArray  # (V, 3) m
    normals: FloatArray  # (V, 3) unit
    tree: KDTree


@dataclass(frozen=True, slots=True, eq=False)
class _System:
    """Normal equations of a frame, mean over the samples."""

    hessian: FloatArray  # (N_POSE + 3 J, same) whole
    gradient: FloatArray  # (N_POSE + 3 J,)


def target(mesh: Mesh) -> Target:
    """Prepare a frame."""
    normals, _ = outward_normals(mesh)
    return Target(mesh.vertices, normals, KDTree(mesh.vertices))


def joint_places(rest: FloatArray, pose: Pose) -> FloatArray:
    """(J, 3) m, the joints of a pose.

    Args:
        rest: (J, 3) m, in the bind frame.
        pose: of the template.
    """
    out = np.empty_like(rest)
    chain_into(PARENTS, rest, pose.rotations, pose.pelvis, out)
    return out


def fit_pose(template: Template, goal: Target, start: Pose, *, reach: FloatArray = FROM_START) -> Pose:
    """Move the template into a captured frame.

    Args:
        template: bound.
        goal: the frame.
        start: where to begin; joints without evidence keep its bends.
        reach: (I,) m, for each step the distance beyond which a point loses its say.
    """
    pose, skin = start, _Skin.of(template)
    bends = _bends(start.rotations)
    for within in reach:
        system = _system(template, skin, goal, pose, within)
        hessian, gradient = system.hessian[:N_POSE, :N_POSE].copy(), system.gradient[:N_POSE].copy()
        off = _turned_off(bends, pose.rotations)
        gradient[6:] -= PULL * off[1:].ravel()
        hessian[np.arange(N_POSE), np.arange(N_POSE)] += DAMPING
        hessian[np.arange(6, N_POSE), np.arange(6, N_POSE)] += PULL
        pose = _stepped(pose, np.asarray(np.linalg.solve(hessian, -gradient), np.float64))
    return pose


def fit_joints(
    template: Template, goals: list[Target], starts: list[Pose], seen: FloatArray, *, rounds: int, pool: Executor
) -> tuple[Template, list[Pose]]:
    """Find where the joints are from frames that differ: where the bones turn.

    Args:
        template: bound, with the plain adult's places of its joints.
        goals: frames.
        starts: poses in them.
        seen: (K, J, 3) m, where the plain adult has the joints in them.
        rounds: how many times poses and places are improved in turn.
        pool: threads.

    Returns:
        The template with its joints moved, and the poses.
    """
    poses = list(pool.map(partial(fit_pose, template), goals, starts))
    prior = _agreed_places(template, poses, seen)
    template, poses = _with_places(template, prior, poses)
    for _ in range(rounds):
        poses = list(pool.map(partial(fit_pose, template, reach=FROM_NEAR), goals, poses))
        look = partial(_places_system, template)
        hessian, gradient = np.zeros((3 * N_JOINTS, 3 * N_JOINTS)), np.zeros(3 * N_JOINTS)
        for mine, slope in pool.map(look, goals, poses):
            hessian += mine * (INDEPENDENT / len(goals))
            gradient += slope * (INDEPENDENT / len(goals))
        _add_priors(template, prior, hessian, gradient)
        step = np.linalg.solve(hessian, -gradient).reshape(-1, 3)
        step[0] = step[HIPS].mean(0)  # nothing turns about the pelvis: it goes with the hips
        template, poses = _with_places(template, template.rest + step, poses)
    return template, poses


@dataclass(frozen=True, slots=True, eq=False)
class _Skin:
    """The samples of a template, as compiled code takes them."""

    points: FloatArray
    normals: FloatArray
    bones: IntArray
    shares: FloatArray

    @classmethod
    def of(cls, template: Template) -> "_Skin":
        """Cut out the samples."""
        at = template.samples
        return cls(template.vertices[at], template.normals[at], *carriers(template.weights[at]))


def _system(template: Template, skin: _Skin, goal: Target, pose: Pose, within: float) -> _System:
    """Normal equations of pose and joints' places where the samples look for the surface now."""
    places = joint_places(template.rest, pose)
    gaps = _gaps(template, skin, goal, pose, places, within)
    size = N_POSE + 3 * N_JOINTS
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    add_surface(
        skin.points, skin.bones, skin.shares, PARENTS, template.rest, pose.rotations, places, gaps, hessian, gradient
    )
    lower = hessian / len(gaps)
    return _System(lower + np.tril(lower, -1).T, gradient / len(gaps))


def _gaps(template: Template, skin: _Skin, goal: Target, pose: Pose, places: FloatArray, within: float) -> FloatArray:
    """(N, 5) of each sample: the normal of the surface that it is held to, the gap along it, and its weight."""
    points, normals = _posed(template, skin, pose, places)
    chosen, square, facing = nearest_facing(goal, points, normals)
    across = goal.normals[chosen]
    gap = (across * (points - goal.points[chosen])).sum(1)
    cost = gap**2 + ALONG * square + (WRONG_WAY * (1.0 - facing)) ** 2
    weight = (within**2 / (within**2 + cost)) ** 2
    return np.column_stack([across, gap, weight])


def posed_samples(template: Template, pose: Pose) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) m and normals (N, 3) of the template's samples in a pose."""
    return _posed(template, _Skin.of(template), pose, joint_places(template.rest, pose))


def posed_template(template: Template, pose: Pose) -> Target:
    """The whole template in a pose, as a surface that points can be held to."""
    skin = _Skin(template.vertices, template.normals, *carriers(template.weights))
    points, normals = _posed(template, skin, pose, joint_places(template.rest, pose))
    length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Target(points, normals / length, KDTree(points))


def _posed(template: Template, skin: _Skin, pose: Pose, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The samples where the joints' places are known."""
    points, normals = np.empty_like(skin.points), np.empty_like(skin.points)
    pose_into(
        *(skin.points, skin.normals, skin.bones, skin.shares),
        *(template.rest, pose.rotations, places, points, normals),
    )
    return points, normals


def nearest_facing(goal: Target, points: FloatArray, normals: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """The captured point that is near and faces the same way.

    Args:
        goal: a frame.
        points: (N, 3) m.
        normals: (N, 3).

    Returns:
        (N,) indices, (N,) m^2 squared distances, (N,) cosines between the normals.
    """
    far, near = goal.tree.query(points, k=min(NEIGHBOURS, len(goal.points)))
    near, square = near.reshape(len(points), -1), far.reshape(len(points), -1) ** 2
    facing = np.einsum("nkc,nc->nk", goal.normals[near], normals)
    best = (square + (WRONG_WAY * (1.0 - facing)) ** 2).argmin(1)
    rows = np.arange(len(points))
    return near[rows, best], square[rows, best], facing[rows, best]


def _places_system(template: Template, goal: Target, pose: Pose) -> tuple[FloatArray, FloatArray]:
    """What one frame says about the joints' places, whatever its pose (Schur complement)."""
    system = _system(template, _Skin.of(template), goal, pose, float(FROM_NEAR[-1]))
    h, g = system.hessian, system.gradient
    posed = h[:N_POSE, :N_POSE] + PULL * np.eye(N_POSE)
    solved = np.linalg.solve(posed, np.column_stack([h[:N_POSE, N_POSE:], g[:N_POSE]]))
    coupled = h[N_POSE:, :N_POSE]
    return h[N_POSE:, N_POSE:] - coupled @ solved[:, :-1], g[N_POSE:] - coupled @ solved[:, -1]


def _add_priors(template: Template, prior: FloatArray, hessian: FloatArray, gradient: FloatArray) -> None:
    """Joints are near where the plain adult has them, and moved alike on both sides."""
    stiff = np.repeat((SURFACE_SPREAD / np.maximum(LOOSE, 1e-4)) ** 2, 3)
    gradient += stiff * (template.rest - prior).ravel()
    hessian[np.arange(len(stiff)), np.arange(len(stiff))] += stiff
    flip = np.array([1.0, -1.0, 1.0])
    pair = (SURFACE_SPREAD / UNLIKE) ** 2
    moved = np.einsum("jkc,jk->jc", template.axes, template.rest - prior)  # in the joints' own axes
    for left in np.flatnonzero(MIRROR > np.arange(N_JOINTS)):
        right = MIRROR[left]
        # rows: front, left, up of the left joint against the mirrored right one
        rows = np.zeros((3, 3 * N_JOINTS))
        rows[:, 3 * left : 3 * left + 3] = template.axes[left].T
        rows[:, 3 * right : 3 * right + 3] = -flip[:, None] * template.axes[right].T
        hessian += pair * rows.T @ rows
        gradient += pair * rows.T @ (moved[left] - flip * moved[right])


def _with_places(template: Template, rest: FloatArray, poses: list[Pose]) -> tuple[Template, list[Pose]]:
    """The template with its joints elsewhere; the pelvis of each pose goes with them."""
    shift = rest[0] - template.rest[0]
    moved = [Pose(pose.rotations, pose.pelvis + pose.rotations[0] @ shift) for pose in poses]
    return replace(template, rest=rest), moved


def _agreed_places(template: Template, poses: list[Pose], seen: FloatArray) -> FloatArray:
    """(J, 3) m, in the bind frame: the median of where frames have each joint on its parent's bone."""
    rest = template.rest.copy()
    for j in range(N_JOINTS):
        up = max(int(PARENTS[j]), 0)
        carried = [
            pose.rotations[up].T @ (places[j] - joint_places(template.rest, pose)[up]) + template.rest[up]
            for pose, places in zip(poses, seen, strict=True)
        ]
        rest[j] = np.median(carried, axis=0)
    return rest


def _bends(rotations: FloatArray) -> FloatArray:
    """(J, 3, 3) each joint in its parent's frame; the pelvis in the world's."""
    up = rotations[PARENTS].copy()
    up[0] = np.eye(3)
    return np.asarray(np.swapaxes(up, 1, 2) @ rotations)


def _turned_off(bends: FloatArray, rotations: FloatArray) -> FloatArray:
    """(J, 3) rad, world turns that would bring the joints back to some bends."""
    up = rotations[PARENTS].copy()
    up[0] = np.eye(3)
    return np.asarray(Rotation.from_matrix(up @ bends @ np.swapaxes(rotations, 1, 2)).as_rotvec())


def _stepped(pose: Pose, step: FloatArray) -> Pose:
    """Shift the pelvis, and turn every joint with all that hangs on it."""
    turns = step[3:].reshape(N_JOINTS, 3)
    angle = np.linalg.norm(turns, axis=1, keepdims=True)
    total = turns * np.minimum(1.0, LARGEST_TURN / np.maximum(angle, 1e-12))
    for j in range(1, N_JOINTS):
        total[j] += total[PARENTS[j]]
    return Pose(Rotation.from_rotvec(total).as_matrix() @ pose.rotations, pose.pelvis + step[:3])
