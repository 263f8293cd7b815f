"""Lays the plain adult into a cloud of oriented surface points by damped Gauss-Newton steps (compiled).

A pose is the rotations of all joints in the world, the pelvis' position and two numbers for the shape: the logarithms
of scale and of stoutness. A step turns joint j, with all that hangs on it, by a small vector w_j in the world.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.body_model import BodyModel

WRONG_SIDE = 0.05  # m: a point whose normal is square to the cone's counts as this far away
SUPPORT = 0.5  # share of its radius that the axis of a cone should lie inside the surface
SUPPORT_WEIGHT = 0.15  # of all such wishes together, against 1 for all surface points
LIMIT_WEIGHT = 2e-3  # m^2 / rad^2
PULL_WEIGHT = 3e-4  # m^2 / rad^2
SHAPE_WEIGHT = 4e-3  # m^2, against growing and getting stout
TRACK_WEIGHT = 2e-4  # m^2 / rad^2, against turning from the pose that was given
SHIFT_WEIGHT = 1e-3  # against shifting the pelvis
LARGEST_TURN = 0.35  # rad a step, each joint
NOTHING_THERE = 1.0  # m^2, what is left where there is no surface
LARGEST_SHAPE = 0.7  # of the logarithms of scale and stoutness


@dataclass(frozen=True, slots=True, eq=False)
class BodyPose:
    """One posture of the plain adult."""

    rotations: FloatArray  # (J, 3, 3) body axes of each joint in the world
    pelvis: FloatArray  # (3,) m
    shape: FloatArray  # (2,) logarithms of scale and stoutness


def fit_body(model: BodyModel, cloud: FloatArray, start: BodyPose, *, sigma: FloatArray) -> tuple[BodyPose, float]:
    """Move a posture until the body's surface fits the points.

    Args:
        model: the body.
        cloud: (N, 7) m, points, unit normals, weights that sum to 1.
        start: where to begin.
        sigma: (I,) m, for each step the distance beyond which a point loses its say.

    Returns:
        The posture, and what is left in m^2 (mean robust distance, and what joints are bent beyond their range).
    """
    if not len(cloud):
        return start, NOTHING_THERE
    rotations, pelvis, shape = start.rotations.copy(), start.pelvis.copy(), start.shape.copy()
    energy = _iterate(
        *(model.parents, model.offsets, model.cone_joint, model.cone_ends, model.cone_radii, model.centres),
        *(model.ranges, model.chains, cloud, sigma, rotations, pelvis, shape),
    )
    return BodyPose(rotations, pelvis, shape), float(energy)


def joint_places(model: BodyModel, pose: BodyPose) -> FloatArray:
    """Positions of the joints, (J, 3) m."""
    places = np.empty((len(model.parents), 3))
    _place(model.parents, model.offsets, pose.rotations, pose.pelvis, pose.shape, places)
    return places


@njit(cache=True, nogil=True)
def _place(
    parents: IntArray,
    offsets: FloatArray,
    rotations: FloatArray,
    pelvis: FloatArray,
    shape: FloatArray,
    out: FloatArray,
) -> None:
    """Positions of the joints into `out`."""
    scale = np.exp(shape[0])
    for k in range(3):
        out[0, k] = pelvis[k]
    for j in range(1, len(parents)):
        p = parents[j]
        for k in range(3):
            out[j, k] = out[p, k]
            for m in range(3):
                out[j, k] += scale * rotations[p, k, m] * offsets[j, m]


@njit(cache=True, nogil=True)
def _cones(
    joints: IntArray, ends: FloatArray, radii: FloatArray, rotations: FloatArray, places: FloatArray, shape: FloatArray
) -> FloatArray:
    """The cones in the world: (8, C) end, end, radius, radius."""
    scale, stout = np.exp(shape[0]), np.exp(shape[0] + shape[1])
    cones = np.empty((8, len(joints)))
    for c in range(len(joints)):
        j = joints[c]
        for e in range(2):
            for k in range(3):
                at = places[j, k]
                for m in range(3):
                    at += scale * rotations[j, k, m] * ends[c, e, m]
                cones[3 * e + k, c] = at
            cones[6 + e, c] = stout * radii[c, e]
    return cones


@njit(cache=True, nogil=True, error_model="numpy")
def _explain(cloud: FloatArray, cones: FloatArray, chosen: IntArray, fits: FloatArray) -> None:
    """For each point the cone that explains it best, its place on that axis, signed distance and squared misfit."""
    n_cones = cones.shape[1]
    along, far, gap = np.empty(n_cones), np.empty(n_cones), np.empty(n_cones)
    for i in range(len(cloud)):
        x, y, z = cloud[i, 0], cloud[i, 1], cloud[i, 2]
        for c in range(n_cones):
            ax, ay, az = cones[3, c] - cones[0, c], cones[4, c] - cones[1, c], cones[5, c] - cones[2, c]
            bx, by, bz = x - cones[0, c], y - cones[1, c], z - cones[2, c]
            at = (ax * bx + ay * by + az * bz) / max(ax * ax + ay * ay + az * az, 1e-12)
            at = min(max(at, 0.0), 1.0)
            bx, by, bz = bx - at * ax, by - at * ay, bz - at * az
            along[c], far[c] = at, np.sqrt(bx * bx + by * by + bz * bz)
            gap[c] = far[c] - cones[6, c] - at * (cones[7, c] - cones[6, c])
        best, best_cost = 0, np.inf
        for c in range(n_cones):
            if gap[c] * gap[c] >= best_cost:
                continue
            facing = 0.0
            for k in range(3):
                facing += cloud[i, 3 + k] * (cloud[i, k] - cones[k, c] - along[c] * (cones[3 + k, c] - cones[k, c]))
            cost = gap[c] * gap[c] + (WRONG_SIDE * (1.0 - facing / max(far[c], 1e-9))) ** 2
            if cost < best_cost:
                best, best_cost = c, cost
        chosen[i], fits[i, 0], fits[i, 1], fits[i, 2] = best, along[best], gap[best], best_cost


@njit(cache=True, nogil=True)
def _add_residuals(
    residuals: FloatArray, riding: IntArray, chains: IntArray, places: FloatArray,
    hessian: FloatArray, gradient: FloatArray,
) -> None:  # fmt: skip
    """Add residuals `gap` = normal . (point - at) - radius, `at` riding on a chain of joints.

    A row holds normal (3), at (3), radius, gap, weight.
    """
    size = len(gradient)
    row, index = np.empty(size), np.empty(size, np.uint64)  # unsigned: none counts from the end
    for r in range(len(residuals)):
        nx, ny, nz = residuals[r, 0], residuals[r, 1], residuals[r, 2]
        grow = radius = residuals[r, 6]
        for k in range(3):
            index[k], row[k] = k, -residuals[r, k]
            grow += residuals[r, k] * (residuals[r, 3 + k] - places[0, k])
        n = 3
        for depth in range(chains.shape[1]):
            j = chains[riding[r], depth]
            if j < 0:
                break
            x, y, z = residuals[r, 3] - places[j, 0], residuals[r, 4] - places[j, 1], residuals[r, 5] - places[j, 2]
            index[n], row[n] = 3 + 3 * j, -(y * nz - z * ny)
            index[n + 1], row[n + 1] = 4 + 3 * j, -(z * nx - x * nz)
            index[n + 2], row[n + 2] = 5 + 3 * j, -(x * ny - y * nx)
            n += 3
        index[n], row[n] = size - 2, -grow
        index[n + 1], row[n + 1] = size - 1, -radius
        for a in range(n + 2):
            value = residuals[r, 8] * row[a]
            gradient[index[a]] += value * residuals[r, 7]
            for b in range(a + 1):
                hessian[max(index[a], index[b]), min(index[a], index[b])] += value * row[b]


@njit(cache=True, nogil=True)
def _add_surface(
    cloud: FloatArray, cones: FloatArray, joints: IntArray, chains: IntArray, places: FloatArray, sigma: float,
    hessian: FloatArray, gradient: FloatArray,
) -> float:  # fmt: skip
    """Every surface point pulls the cone that explains it best; returns the mean robust squared misfit."""
    chosen, fits = np.empty(len(cloud), np.int64), np.empty((len(cloud), 3))
    _explain(cloud, cones, chosen, fits)
    residuals, riding = np.empty((len(cloud), 9)), np.empty(len(cloud), np.int64)
    energy, room = 0.0, sigma * sigma
    for i in range(len(cloud)):
        c, along, cost = chosen[i], fits[i, 0], fits[i, 2]
        share = room / (room + cost)
        energy += cloud[i, 6] * cost * share
        far = 1e-12
        for k in range(3):
            residuals[i, 3 + k] = cones[k, c] + along * (cones[3 + k, c] - cones[k, c])
            residuals[i, k] = cloud[i, k] - residuals[i, 3 + k]
            far += residuals[i, k] * residuals[i, k]
        for k in range(3):
            residuals[i, k] /= np.sqrt(far)
        residuals[i, 6] = cones[6, c] + along * (cones[7, c] - cones[6, c])
        residuals[i, 7], residuals[i, 8] = fits[i, 1], cloud[i, 6] * share * share
        riding[i] = joints[c]
    _add_residuals(residuals, riding, chains, places, hessian, gradient)
    return energy


@njit(cache=True, nogil=True)
def _add_support(
    cloud: FloatArray, cones: FloatArray, joints: IntArray, chains: IntArray, places: FloatArray, sigma: float,
    hessian: FloatArray, gradient: FloatArray,
) -> float:  # fmt: skip
    """Every cone's axis wishes to lie inside the surface; returns what is left of the wishes."""
    residuals, riding = np.zeros((3 * len(joints), 9)), np.empty(3 * len(joints), np.int64)
    points, squares = cloud[:, :3].T.copy(), np.empty(len(cloud))
    energy, room, n = 0.0, sigma * sigma, 0
    share_each = SUPPORT_WEIGHT / (3 * len(joints))
    for c in range(len(joints)):
        for step in range(3):
            along = 0.5 * step
            for k in range(3):
                residuals[n, 3 + k] = cones[k, c] + along * (cones[3 + k, c] - cones[k, c])
            x, y, z = residuals[n, 3], residuals[n, 4], residuals[n, 5]
            for i in range(len(cloud)):
                squares[i] = (points[0, i] - x) ** 2 + (points[1, i] - y) ** 2 + (points[2, i] - z) ** 2
            nearest = 0
            for i in range(1, len(cloud)):
                if squares[i] < squares[nearest]:
                    nearest = i
            gap = SUPPORT * (cones[6, c] + along * (cones[7, c] - cones[6, c]))
            for k in range(3):
                residuals[n, k] = -cloud[nearest, 3 + k]
                gap -= residuals[n, k] * (residuals[n, 3 + k] - cloud[nearest, k])
            if gap <= 0.0:
                continue
            share = room / (room + gap * gap)
            energy += share_each * gap * gap * share
            residuals[n, 7], residuals[n, 8], riding[n] = gap, share_each * share * share, joints[c]
            n += 1
    _add_residuals(residuals[:n], riding, chains, places, hessian, gradient)
    return energy


@njit(cache=True, nogil=True)
def _turn(x: float, y: float, z: float) -> FloatArray:
    """The rotation of a rotation vector."""
    angle = np.sqrt(x * x + y * y + z * z)
    sine = np.sin(angle) / max(angle, 1e-12)
    versine = (1.0 - np.cos(angle)) / max(angle * angle, 1e-24)
    vector = (x, y, z)
    out = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            out[i, k] = versine * vector[i] * vector[k]
        out[i, i] += np.cos(angle)
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        out[m, k] += sine * vector[i]
        out[k, m] -= sine * vector[i]
    return out


@njit(cache=True, nogil=True)
def _vector(rotation: FloatArray) -> FloatArray:
    """The rotation vector of a rotation."""
    vector = np.empty(3)
    sine = 0.0
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        vector[i] = 0.5 * (rotation[m, k] - rotation[k, m])
        sine += vector[i] * vector[i]
    sine = np.sqrt(sine)
    if sine > 1e-9:
        angle = np.arctan2(sine, 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0))
        for i in range(3):
            vector[i] *= angle / sine
    return vector


@njit(cache=True, nogil=True)
def _product(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """The product of two 3 x 3 matrices into a third."""
    for i in range(3):
        for k in range(3):
            out[i, k] = a[i, 0] * b[0, k] + a[i, 1] * b[1, k] + a[i, 2] * b[2, k]


@njit(cache=True, nogil=True)
def _add_limits(
    parents: IntArray, centres: FloatArray, ranges: FloatArray, rotations: FloatArray,
    hessian: FloatArray, gradient: FloatArray,
) -> float:  # fmt: skip
    """Joints bent beyond their range cost, and a weak pull leads to its middle; returns the cost."""
    energy = 0.0
    frame, bend = np.empty((3, 3)), np.empty((3, 3))
    for j in range(1, len(parents)):
        p = parents[j]
        _product(rotations[p], centres[j], frame)
        _product(frame.T, rotations[j], bend)
        vector = _vector(bend)
        for k in range(3):
            beyond = vector[k] - min(max(vector[k], ranges[j, 0, k]), ranges[j, 1, k])
            off = vector[k] - 0.5 * (ranges[j, 0, k] + ranges[j, 1, k])
            pull = PULL_WEIGHT * ranges[j, 2, k]
            stiff = pull + (LIMIT_WEIGHT if beyond != 0.0 else 0.0)
            force = pull * off + LIMIT_WEIGHT * beyond
            energy += pull * off * off + LIMIT_WEIGHT * beyond * beyond
            for a in range(3):
                gradient[3 + 3 * j + a] += force * frame[a, k]
                for b in range(a + 1):
                    hessian[3 + 3 * j + a, 3 + 3 * j + b] += stiff * frame[a, k] * frame[b, k]
    return energy


@njit(cache=True, nogil=True)
def _solve(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """Solve hessian @ step = -gradient by Cholesky; only the lower triangle is read, and it is overwritten."""
    n = len(gradient)
    step = -gradient
    for i in range(n):
        for k in range(i + 1):
            value = hessian[i, k]
            for m in range(k):
                value -= hessian[i, m] * hessian[k, m]
            hessian[i, k] = np.sqrt(max(value, 1e-14)) if i == k else value / hessian[k, k]
    for i in range(n):
        for m in range(i):
            step[i] -= hessian[i, m] * step[m]
        step[i] /= hessian[i, i]
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, n):
            step[i] -= hessian[m, i] * step[m]
        step[i] /= hessian[i, i]
    return step


@njit(cache=True, nogil=True)
def _apply(step: FloatArray, parents: IntArray, rotations: FloatArray, pelvis: FloatArray, shape: FloatArray) -> None:
    """Take a step: shift the pelvis, grow, and turn every joint with all that hangs on it."""
    n_joints = len(parents)
    turn, turned = np.zeros((n_joints, 3)), np.empty((3, 3))
    for k in range(3):
        pelvis[k] += step[k]
    for k in range(2):
        shape[k] = min(max(shape[k] + step[3 + 3 * n_joints + k], -LARGEST_SHAPE), LARGEST_SHAPE)
    for j in range(n_joints):
        most = 0.0
        for k in range(3):
            most += step[3 + 3 * j + k] ** 2
        share = min(1.0, LARGEST_TURN / max(np.sqrt(most), 1e-12))
        for k in range(3):
            turn[j, k] = share * step[3 + 3 * j + k]
            if parents[j] >= 0:
                turn[j, k] += turn[parents[j], k]
        by = _turn(turn[j, 0], turn[j, 1], turn[j, 2])
        _product(by, rotations[j], turned)
        for i in range(3):
            for k in range(3):
                rotations[j, i, k] = turned[i, k]


@njit(cache=True, nogil=True)
def _iterate(
    parents: IntArray, offsets: FloatArray, joints: IntArray, ends: FloatArray, radii: FloatArray,
    centres: FloatArray, ranges: FloatArray, chains: IntArray, cloud: FloatArray, sigma: FloatArray,
    rotations: FloatArray, pelvis: FloatArray, shape: FloatArray,
) -> float:  # fmt: skip
    """The loop; `rotations`, `pelvis` and `shape` are changed in place."""
    n_joints = len(parents)
    size = 5 + 3 * n_joints
    places = np.empty((n_joints, 3))
    energy = np.inf
    for it in range(len(sigma)):
        _place(parents, offsets, rotations, pelvis, shape, places)
        cones = _cones(joints, ends, radii, rotations, places, shape)
        hessian, gradient = np.zeros((size, size)), np.zeros(size)
        energy = _add_surface(cloud, cones, joints, chains, places, sigma[it], hessian, gradient)
        energy += _add_support(cloud, cones, joints, chains, places, sigma[it], hessian, gradient)
        energy += _add_limits(parents, centres, ranges, rotations, hessian, gradient)
        for k in range(2):
            energy += SHAPE_WEIGHT * shape[k] ** 2
            gradient[size - 2 + k] += SHAPE_WEIGHT * shape[k]
            hessian[size - 2 + k, size - 2 + k] += SHAPE_WEIGHT
        for k in range(3, size - 2):
            hessian[k, k] += TRACK_WEIGHT
        for k in range(3):
            hessian[k, k] += SHIFT_WEIGHT
        if it == len(sigma) - 1:
            break
        _apply(_solve(hessian, gradient), parents, rotations, pelvis, shape)
    return energy
