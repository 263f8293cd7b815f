"""Which pairs of limbs the joint limits let meet at all (Liu et al., A4.5), in two modes.

`safely_reachable_pairs` drops a pair only on a proof: the box of all postures is cut up until in every part of it
balls round the two limbs stay apart. In a part, a joint turns by no more than some angle a away from the middle
posture, and moves a point at distance d by at most 2 d sin(a / 2). Sampling alone is no proof: rare encounters go on
to appear for as long as one samples.

`often_meeting_pairs` drops what sampled postures, or a project's own motions, bring together too rarely.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from mhvedit.collision.detect import CollisionBody, surfaces_cross
from mhvedit.collision.limbs import LimbArrays, Limbs
from mhvedit.collision.pairs import LimbPairs
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import forward_into
from mhvedit.skeleton.model import Skeleton

STACK: Final = 2000  # parts that wait; each is half of the one before
PARTS: Final = 1000  # of the postures of a pair that are looked at before it counts as reachable
BALL: Final = 0.04  # m, half the length of a box that gets one ball
RATE: Final = 1e-3  # share of postures in which a pair has to meet
CHUNK: Final = 2000  # sampled postures at a time


@dataclass(frozen=True, slots=True, eq=False)
class Balls:
    """Balls that contain the limbs in every posture, skinned or rigid."""

    start: IntArray  # (L + 1,)
    centre: FloatArray  # (B, 3) m at rest, world; moves with the limb's joint
    radius: FloatArray  # (B,) m


def safely_reachable_pairs(body: CollisionBody, *, parts: int = PARTS, rigid: bool = False) -> LimbPairs:
    """The body's pairs but those that provably never meet within the joint limits.

    Args:
        body: prepared; its pairs are looked at.
        parts: how many parts of the postures to look at for each pair; more prove more.
        rigid: limbs keep their shape at rest, which proves more; not for detection on skinned limbs.
    """
    skeleton, limbs = body.body.skeleton, body.limbs
    balls = limb_balls(body, rigid=rigid)
    kept = [not _never_meet(skeleton, balls, limbs, int(a), int(b), parts=parts) for a, b in body.pairs.limbs]
    return LimbPairs(body.pairs.limbs[np.array(kept, np.bool_)])


def often_meeting_pairs(body: CollisionBody, q: FloatArray, *, rate: float = RATE, rigid: bool = True) -> LimbPairs:
    """The body's pairs whose surfaces cross in a share of postures.

    Args:
        body: prepared; its pairs are looked at.
        q: (T, D) sampled (`random_postures`) or of the project's motions.
        rate: least share.
        rigid: limbs keep their shape at rest.
    """
    return LimbPairs(body.pairs.limbs[meeting_rates(body, q, rigid=rigid) >= rate])


def meeting_rates(body: CollisionBody, q: FloatArray, *, rigid: bool = True) -> FloatArray:
    """(P,) share of postures (T, D) in which the surfaces of each pair cross."""
    met = np.zeros(len(body.pairs.limbs))
    for start in range(0, len(q), CHUNK):
        met += surfaces_cross(body, q[start : start + CHUNK], rigid=rigid).sum(0)
    return met / max(len(q), 1)


def random_postures(skeleton: Skeleton, count: int, rng: np.random.Generator) -> FloatArray:
    """(T, D) postures that are uniform within the limits; the root stays, other free turns go all the way round."""
    low, high = _bounds(skeleton)
    root = skeleton.dof_joint == 0
    low, high = np.where(root, 0.0, low), np.where(root, 0.0, high)
    return rng.uniform(low, high, (count, skeleton.n_dofs))


def limb_balls(body: CollisionBody, *, rigid: bool = False) -> Balls:
    """Balls round the small boxes of each limb, wide enough for what skinning does to it unless limbs are rigid.

    A skinned vertex lies among where its joints would carry it. Seen from its limb, each of them has moved it by no
    more than the joints between may turn.
    """
    arrays, skeleton = body.limbs.arrays, body.body.skeleton
    local = body.limbs.local
    margin = np.zeros(len(local)) if rigid else _skin_margins(body)
    starts, centres, radii = [0], [], []
    for limb in range(body.limbs.n_limbs):
        for box in _small_boxes(body, int(arrays.root[limb])):
            own = np.unique(arrays.faces[_faces_below(arrays, box)])
            middle = (local[own].min(0) + local[own].max(0)) / 2
            radii.append(float((np.linalg.norm(local[own] - middle, axis=1) + margin[own]).max()))
            centres.append(arrays.axes[limb] @ middle + skeleton.rest_positions[arrays.joints[limb]])
        starts.append(len(radii))
    return Balls(np.array(starts), np.array(centres), np.array(radii))


def _small_boxes(body: CollisionBody, root: int) -> list[int]:
    """The largest boxes of a limb that are small enough, or cannot be opened."""
    arrays, waiting, found = body.limbs.arrays, [root], []
    while waiting:
        box = waiting.pop()
        if arrays.leaf[box] or arrays.half[box].max() <= BALL:
            found.append(box)
        else:
            waiting += range(arrays.first[box], arrays.first[box] + arrays.size[box])
    return found


def _faces_below(arrays: LimbArrays, box: int) -> IntArray:
    """Triangles in a box, which stand one after the other."""
    first = last = box
    while not arrays.leaf[first]:
        first = int(arrays.first[first])
    while not arrays.leaf[last]:
        last = int(arrays.first[last] + arrays.size[last] - 1)
    return np.arange(arrays.first[first], arrays.first[last] + arrays.size[last])


def _bounds(skeleton: Skeleton) -> tuple[FloatArray, FloatArray]:
    """(D,) least and largest value of each DOF; free turns go all the way round.

    Raises:
        ShapeError: a slide is free that is not the root's.
    """
    free = ~np.isfinite(skeleton.limits).all(1)
    loose = free & skeleton.dof_slides & (skeleton.dof_joint > 0)
    if loose.any():
        name = skeleton.dof_names[int(np.argmax(loose))]
        raise ShapeError("limits", f"none for {name}", "finite limits for everything that slides but the root")
    return np.where(free, -np.pi, skeleton.limits[:, 0]), np.where(free, np.pi, skeleton.limits[:, 1])


def _between(skeleton: Skeleton, a: int, b: int) -> list[int]:
    """Joints whose DOFs move joint b against joint a, from a's end to b's."""
    up_a, up_b = _upwards(skeleton, a), _upwards(skeleton, b)
    common = set(up_a) & set(up_b)
    return [j for j in up_a if j not in common] + [j for j in up_b if j not in common][::-1]


def _upwards(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all above it."""
    way = [joint]
    while skeleton.parents[way[-1]] >= 0:
        way.append(int(skeleton.parents[way[-1]]))
    return way


def _skin_margins(body: CollisionBody) -> FloatArray:
    """(N,) m, how far skinning can carry each limb vertex away from where its limb's joint alone would."""
    skeleton, arrays = body.body.skeleton, body.limbs.arrays
    low, high = _bounds(skeleton)
    reach = np.bincount(skeleton.dof_joint, np.maximum(np.abs(low), np.abs(high)), minlength=skeleton.n_joints)
    swing = 2.0 * np.sin(np.minimum(reach, np.pi) / 2.0)
    rest, weights = skeleton.rest_positions, body.body.weights / body.body.weights.sum(1, keepdims=True)
    margin = np.zeros(len(arrays.vertex))
    for limb, owner in enumerate(arrays.joints):
        own = slice(arrays.vertex_start[limb], arrays.vertex_start[limb + 1])
        vertex = arrays.vertex[own]
        for joint in np.flatnonzero((weights[vertex] > 0).any(0)):
            hinges = _between(skeleton, int(owner), int(joint))[::-1]
            far = [np.linalg.norm(body.body.vertices[vertex] - rest[hinge], axis=1) for hinge in hinges]
            moved, chain = np.zeros(len(vertex)), far[0].copy() if hinges else 0.0
            for k, hinge in enumerate(hinges):
                if k > 0:  # no bone is stretched
                    chain = chain + np.linalg.norm(rest[hinge] - rest[hinges[k - 1]])
                moved = np.minimum(moved + swing[hinge] * np.minimum(far[k] + moved, chain), far[k] + chain)
            margin[own] += weights[vertex, joint] * moved
    return margin


def _never_meet(skeleton: Skeleton, balls: Balls, limbs: Limbs, a: int, b: int, *, parts: int) -> bool:
    """Whether the balls of two limbs stay apart in all postures; False also where the proof takes too long."""
    joints = limbs.arrays.joints
    hinges = np.array(_between(skeleton, int(joints[a]), int(joints[b])), np.int64)
    chain_a, chain_b = hinges[: len(hinges) // 2], hinges[len(hinges) // 2 :][::-1].copy()  # from each limb inwards
    dofs = np.flatnonzero(np.isin(skeleton.dof_joint, hinges))
    low, high = _bounds(skeleton)
    mine, other = slice(balls.start[a], balls.start[a + 1]), slice(balls.start[b], balls.start[b + 1])
    rest = skeleton.rest_positions
    return bool(
        _apart_everywhere(
            skeleton.parents,
            skeleton.offsets,
            skeleton.dof_joint,
            skeleton.dof_axis,
            skeleton.dof_slides,
            dofs,
            low[dofs],
            high[dofs],
            int(joints[a]),
            chain_a,
            balls.centre[mine] - rest[joints[a]],
            balls.radius[mine],
            int(joints[b]),
            chain_b,
            balls.centre[other] - rest[joints[b]],
            balls.radius[other],
            parts,
        )
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _apart_everywhere(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    dofs: IntArray,
    low: FloatArray,
    high: FloatArray,
    joint_a: int,
    chain_a: IntArray,
    centre_a: FloatArray,
    radius_a: FloatArray,
    joint_b: int,
    chain_b: IntArray,
    centre_b: FloatArray,
    radius_b: FloatArray,
    parts: int,
) -> bool:
    """Cut the box of postures up until the balls are apart in every part, or there are too many parts."""
    n_joints, n = parents.shape[0], dofs.shape[0]
    q, turn = np.zeros(dof_joint.shape[0]), np.zeros(n_joints)
    rotations, positions = np.empty((n_joints, 3, 3)), np.empty((n_joints, 3))
    world_a, world_b = np.empty((len(radius_a), 3)), np.empty((len(radius_b), 3))
    reach_a, reach_b = np.empty(len(radius_a)), np.empty(len(radius_b))
    stack = np.empty((STACK, n, 2))
    stack[0, :, 0], stack[0, :, 1], top, looked = low, high, 1, 0
    while top > 0:
        top -= 1
        looked += 1
        if looked > parts or top + 2 > STACK:
            return False
        part = stack[top].copy()
        for k in range(n):
            q[dofs[k]] = 0.5 * (part[k, 0] + part[k, 1])
        _swings_into(dofs, dof_joint, dof_axis, part, turn)
        forward_into(parents, offsets, dof_joint, dof_axis, dof_slides, q, rotations, positions)
        _place_balls(rotations, positions, turn, joint_a, chain_a, centre_a, radius_a, world_a, reach_a)
        _place_balls(rotations, positions, turn, joint_b, chain_b, centre_b, radius_b, world_b, reach_b)
        if _all_apart(world_a, reach_a, world_b, reach_b):
            continue
        widest = _widest(part, dofs, dof_joint, positions, world_a, world_b, chain_a)
        stack[top], stack[top + 1] = part, part
        middle = 0.5 * (part[widest, 0] + part[widest, 1])
        stack[top, widest, 1] = stack[top + 1, widest, 0] = middle
        top += 2
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _swings_into(dofs: IntArray, dof_joint: IntArray, dof_axis: FloatArray, part: FloatArray, turn: FloatArray) -> None:
    """By how much each joint may turn away from the middle posture of a part, (J,) rad, at most.

    A straight way through the part turns the joint by no more than its length: half widths squared and summed, and
    their products where two axes are not square to each other. The first and the third of three square axes are at
    the angle that the second makes.
    """
    turn[:] = 0.0
    start = 0
    while start < dofs.shape[0]:
        stop = start + 1
        while stop < dofs.shape[0] and dof_joint[dofs[stop]] == dof_joint[dofs[start]]:
            stop += 1
        square = 0.0
        for i in range(start, stop):
            for j in range(start, stop):
                cosine = 1.0
                if j != i:
                    u, v = dof_axis[dofs[i]], dof_axis[dofs[j]]
                    cosine = abs(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])
                    if abs(i - j) == 2:
                        between = max(abs(part[start + 1, 0]), abs(part[start + 1, 1]))
                        cosine = 1.0 if cosine > 1e-9 else np.sin(min(between, np.pi / 2.0))
                square += 0.25 * cosine * (part[i, 1] - part[i, 0]) * (part[j, 1] - part[j, 0])
        turn[dof_joint[dofs[start]]] = np.sqrt(square)
        start = stop


@njit(cache=True, nogil=True, error_model="numpy")
def _place_balls(
    rotations: FloatArray,
    positions: FloatArray,
    turn: FloatArray,
    joint: int,
    chain: IntArray,
    centre: FloatArray,
    radius: FloatArray,
    world: FloatArray,
    reach: FloatArray,
) -> None:
    """Balls in the middle posture, and balls that contain them in all postures of the part.

    Seen from the middle of the way between the limbs: from the limb inwards, each joint swings what is beyond it, which
    has been swung by the joints there.
    """
    for i in range(centre.shape[0]):
        for r in range(3):
            world[i, r] = positions[joint, r]
            for c in range(3):
                world[i, r] += rotations[joint, r, c] * centre[i, c]
        moved = 0.0
        for k in range(chain.shape[0]):
            hinge = chain[k]
            far = 0.0
            for r in range(3):
                far += (world[i, r] - positions[hinge, r]) ** 2
            moved += 2.0 * np.sin(min(turn[hinge], np.pi) / 2.0) * (np.sqrt(far) + moved)
        reach[i] = radius[i] + moved


@njit(cache=True, nogil=True, error_model="numpy")
def _all_apart(a: FloatArray, radius_a: FloatArray, b: FloatArray, radius_b: FloatArray) -> bool:
    """Whether no ball of one set meets one of the other."""
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            far = (a[i, 0] - b[j, 0]) ** 2 + (a[i, 1] - b[j, 1]) ** 2 + (a[i, 2] - b[j, 2]) ** 2
            if far <= (radius_a[i] + radius_b[j]) ** 2:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _widest(
    part: FloatArray,
    dofs: IntArray,
    dof_joint: IntArray,
    positions: FloatArray,
    a: FloatArray,
    b: FloatArray,
    chain_a: IntArray,
) -> int:
    """The DOF that moves its limb most within a part."""
    best, which = -1.0, 0
    for k in range(dofs.shape[0]):
        joint, points = dof_joint[dofs[k]], b
        for c in range(chain_a.shape[0]):
            if chain_a[c] == joint:
                points = a
        far = 0.0
        for i in range(points.shape[0]):
            square = 0.0
            for r in range(3):
                square += (points[i, r] - positions[joint, r]) ** 2
            far = max(far, square)
        moved = (part[k, 1] - part[k, 0]) * np.sqrt(far)
        if moved > best:
            best, which = moved, k
    return which
