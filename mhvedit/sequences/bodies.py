"""Follows the plain adult through a capture: started anew in a few key frames, tracked between, the best way chosen."""

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose, invert
from mhvedit.sequences.body_fit import BodyPose, fit_body, joint_places
from mhvedit.sequences.body_model import (
    LEFT_ELBOW,
    LEFT_HIP,
    LEFT_KNEE,
    LEFT_SHOULDER,
    LUMBAR,
    NECK,
    RIGHT_ELBOW,
    RIGHT_HIP,
    RIGHT_KNEE,
    RIGHT_SHOULDER,
    BodyModel,
    plain_adult,
    rotation_from_vector,
)  # fmt: skip
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.surface_cloud import own_frame, surface_cloud

FINE, COARSE = 0.055, 0.09  # m, cells of the cloud for tracking and for starting
KEY_SPACING = 60  # frames between two starts
N_YAWS = 8  # directions in which each posture is tried
N_RIVALS = 2  # further starts tracked beside the best one ...
RIVAL_ENERGY = 1.6  # ... if they fit nearly as well
RIVAL_TURN = np.radians(50)  # ... and face elsewhere
# how many starts survive each look, and the distances (m) beyond which a point loses its say, step by step
LOOKS = ((48, np.full(3, 0.25)), (12, np.full(4, 0.25)), (6, np.r_[np.full(8, 0.12), np.full(6, 0.06)]))
TRACKING = np.r_[0.12, np.full(6, 0.06)]
POOR = 1.6  # times the median misfit: such a frame gets a second start ...
CHANCE_SPACING = 30  # ... as long as there are no more than one in so many frames; tracked so far to both sides
ENERGY_SCALE = 2e-4  # m^2, worth one unit in the choice of the way through the frames
TURN_SCALE = 0.35  # change of the left-right axis between neighbouring frames that is worth one unit
OTHERWISE_SCALE = 0.35  # difference to a given facing that is worth one unit

# degrees: roll and pitch of the trunk; arm out, arm forward, elbow, hip, knee, leg out, bend of the back
_POSTURES = (
    (0, 0, 15, 0, 10, 0, 0, 0, 0),  # standing
    (0, 0, 85, 0, 0, 0, 0, 0, 0),  # arms to the sides
    (0, 0, 10, 70, 20, 0, 0, 0, 0),  # reaching
    (0, 0, 20, 20, 40, 20, 30, 10, 0),  # knees soft
    (0, 60, 10, 80, 0, 60, 20, 0, 0),  # bowing
    (0, 20, 20, 40, 40, 90, 100, 0, 0),  # crouching
    (0, 80, 10, 85, 0, 80, 85, 0, 0),  # on all fours
    (0, 75, 20, 85, 0, 0, 0, 0, 0),  # push-up
    (0, 90, 85, 0, 0, 0, 0, 0, 0),  # face down, arms to the sides
    (0, -90, 30, 0, 0, 0, 0, 0, 0),  # on the back
    (0, -90, 85, 0, 0, 0, 0, 0, 0),  # on the back, arms to the sides
    (0, -80, 30, 20, 30, 70, 90, 0, 0),  # on the back, knees up
    (90, 0, 20, 40, 40, 30, 40, 0, 0),  # on the right side
    (-90, 0, 20, 40, 40, 30, 40, 0, 0),  # on the left side
    (0, 0, 20, 20, 30, 90, 90, 0, 0),  # sitting
)


@dataclass(frozen=True, slots=True, eq=False)
class BodyTrack:
    """The plain adult in every frame of a capture."""

    numbers: IntArray  # (T,) frame numbers
    places: FloatArray  # (T, J, 3) m, joints
    rotations: FloatArray  # (T, J, 3, 3) axes of the joints: front, left, up in the columns where the adult stands
    misfit: FloatArray  # (T,) m^2, mean robust squared distance and bending beyond the joints' range
    shape: FloatArray  # (T, 2) logarithms of scale and stoutness against the plain adult

    @property
    def head(self) -> FloatArray:
        """(T, 3, 3) axes of the head: front, left, up in the columns."""
        return self.rotations[:, NECK]

    @property
    def size(self) -> FloatArray:
        """(T,) scale against the plain adult."""
        return np.asarray(np.exp(self.shape[:, 0]))


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A pose that one of the tracks has in a frame."""

    pose: BodyPose
    energy: float
    across: FloatArray  # (3,) unit, from left to right through hips and shoulders


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What the search for the body goes by."""

    model: BodyModel
    clouds: list[FloatArray]  # fine, of all frames
    yaw: FloatArray | None  # (T,) rad, where the body faces, if that is known
    pool: Executor


def track_body(sequence: MeshSequence, *, yaw: FloatArray | None = None, workers: int = 1) -> BodyTrack:
    """Lay the plain adult into every frame.

    Args:
        sequence: the capture.
        yaw: (T,) rad, where the body faces, if that is known.
        workers: threads; the result does not depend on it.

    Returns:
        The body in the capture's frame; it turns and shifts with the capture.
    """
    model = plain_adult()
    numbers = np.array(sequence.numbers)
    own_from_capture = own_frame(sequence.mesh(sequence.numbers[0]))
    own_yaw = None if yaw is None else np.asarray(yaw) + own_from_capture[2]
    with ThreadPoolExecutor(workers) as pool:
        look = partial(_clouds, sequence, own_from_capture, frozenset(_key_frames(len(numbers))))
        clouds = list(pool.map(look, range(len(numbers))))
        search = _Search(model, [fine for fine, _ in clouds], own_yaw, pool)
        shelves = _shelves(search, {at: coarse for at, (_, coarse) in enumerate(clouds) if coarse is not None})
        _second_chances(search, sequence, own_from_capture, shelves)
    return _in_capture(model, numbers, _best_way(shelves, own_yaw), own_from_capture)


def horizontal_front(across: FloatArray) -> FloatArray:
    """Yaw (...) rad of the horizontal direction that has `across` (..., 3), left to right, at its right hand."""
    return np.asarray(np.arctan2(across[..., 0], -across[..., 1]))


def across_body(places: FloatArray) -> FloatArray:
    """Left to right through hips and shoulders, each line counting the same.

    Args:
        places: (..., J, 3) m, joints.

    Returns:
        (..., 3), at most of length 1.
    """
    lines = [(LEFT_HIP, RIGHT_HIP), (LEFT_SHOULDER, RIGHT_SHOULDER)]
    steps = [places[..., right, :] - places[..., left, :] for left, right in lines]
    units = [step / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-12) for step in steps]
    return np.asarray((units[0] + units[1]) / 2)


def _clouds(
    sequence: MeshSequence, own_from_capture: FloatArray, keys: frozenset[int], at: int
) -> tuple[FloatArray, FloatArray | None]:
    """The fine cloud of a frame, and in key frames the coarse one."""
    mesh = sequence.mesh(sequence.numbers[at])
    coarse = surface_cloud(mesh, own_from_capture, cell=COARSE) if at in keys else None
    return surface_cloud(mesh, own_from_capture, cell=FINE), coarse


def _shelves(search: _Search, coarse: dict[int, FloatArray]) -> list[list[_Candidate]]:
    """For each frame the poses that the body has there in the tracks from the key frames before and after it."""
    keys = sorted(coarse)
    tracks: list[tuple[BodyPose, range]] = []
    for at, key in enumerate(keys):
        before, after = keys[max(at - 1, 0)], keys[min(at + 1, len(keys) - 1)]
        ways = range(key, after + 1), range(key - 1, before - 1, -1)
        tracks += product(_start(search, coarse[key], key), ways)
    shelves: list[list[_Candidate]] = [[] for _ in search.clouds]
    _follow(search, tracks, shelves)
    return shelves


def _key_frames(n_frames: int) -> list[int]:
    """Indices of the frames in which the body is looked for anew: first, last and evenly between."""
    pieces = max(1, round((n_frames - 1) / KEY_SPACING))
    return sorted({round(k * (n_frames - 1) / pieces) for k in range(pieces + 1)})


def _posture(model: BodyModel, posture: tuple[float, ...], yaw: float) -> BodyPose:
    """One of the table's postures, turned to a direction, pelvis at the origin."""
    roll, pitch, out, forward, elbow, hip, knee, leg_out, back = np.radians(posture)
    bend = {LEFT_SHOULDER: (out, -forward, 0), RIGHT_SHOULDER: (-out, -forward, 0)}
    bend |= {LEFT_ELBOW: (0, -elbow, 0), RIGHT_ELBOW: (0, -elbow, 0), LUMBAR: (0, back, 0)}
    bend |= {LEFT_HIP: (leg_out, -hip, 0), RIGHT_HIP: (-leg_out, -hip, 0)}
    bend |= {LEFT_KNEE: (0, knee, 0), RIGHT_KNEE: (0, knee, 0)}
    tilt = rotation_from_vector(np.array([roll, 0.0, 0.0])) @ rotation_from_vector(np.array([0.0, pitch, 0.0]))
    turn = rotation_from_vector(np.array([0.0, 0.0, yaw])) @ tilt
    rotations = np.tile(turn, (len(model.parents), 1, 1))
    for joint in range(1, len(model.parents)):
        own = rotation_from_vector(np.array(bend.get(joint, (0, 0, 0)), np.float64))
        rotations[joint] = rotations[model.parents[joint]] @ own
    return BodyPose(rotations, np.zeros(3), np.zeros(2))


def _centre(model: BodyModel, pose: BodyPose) -> FloatArray:
    """Roughly the centre of the posture's surface, (3,) m."""
    middles = np.einsum("cij,cj->ci", pose.rotations[model.cone_joint], model.cone_ends.mean(1))
    middles += joint_places(model, pose)[model.cone_joint]
    length = np.linalg.norm(model.cone_ends[:, 0] - model.cone_ends[:, 1], axis=1)
    area = model.cone_radii.sum(1) * (length + 0.1)
    return np.asarray(area @ middles / area.sum())


def _start(search: _Search, coarse: FloatArray, frame: int) -> list[BodyPose]:
    """Where the body may be in a frame, the best first; rivals only if they fit nearly as well and face elsewhere."""
    model, fine = search.model, search.clouds[frame]
    yaws = 2 * np.pi * np.arange(N_YAWS) / N_YAWS if search.yaw is None else search.yaw[frame : frame + 1]
    centre = coarse[:, 6] @ coarse[:, :3]
    tries = [_posture(model, posture, angle) for posture in _POSTURES for angle in yaws]
    tries = [BodyPose(pose.rotations, centre - _centre(model, pose), pose.shape) for pose in tries]
    for kept, sigma in LOOKS:
        tries = [pose for _, pose in _fit_all(search, coarse, tries, sigma)[:kept]]
    found = _fit_all(search, fine, tries, TRACKING)
    chosen: list[BodyPose] = []
    fronts: list[float] = []
    for energy, pose in found:
        front = float(horizontal_front(across_body(joint_places(model, pose))))
        new = all(abs((front - other + np.pi) % (2 * np.pi) - np.pi) > RIVAL_TURN for other in fronts)
        if new and energy <= RIVAL_ENERGY * found[0][0] and len(chosen) <= N_RIVALS:
            chosen.append(pose)
            fronts.append(front)
    return chosen


def _fit_all(
    search: _Search, cloud: FloatArray, poses: list[BodyPose], sigma: FloatArray
) -> list[tuple[float, BodyPose]]:
    """Fit each posture; the best first."""
    fits = search.pool.map(lambda pose: fit_body(search.model, cloud, pose, sigma=sigma), poses)
    return sorted(((energy, pose) for pose, energy in fits), key=lambda found: found[0])


def _follow(search: _Search, tracks: list[tuple[BodyPose, range]], shelves: list[list[_Candidate]]) -> None:
    """Track postures through frames and put what is found on each frame's shelf, one track after the other."""
    found = search.pool.map(lambda track: _tracked(search, *track), tracks)
    for (_, frames), candidates in zip(tracks, found, strict=True):
        for frame, candidate in zip(frames, candidates, strict=True):
            shelves[frame].append(candidate)


def _tracked(search: _Search, pose: BodyPose, frames: range) -> list[_Candidate]:
    """One posture through some frames, each begun from the last."""
    candidates = []
    for frame in frames:
        pose, energy = fit_body(search.model, search.clouds[frame], pose, sigma=TRACKING)
        candidates.append(_Candidate(pose, energy, across_body(joint_places(search.model, pose))))
    return candidates


def _second_chances(
    search: _Search, sequence: MeshSequence, own_from_capture: FloatArray, shelves: list[list[_Candidate]]
) -> None:
    """Where every track fits poorly the body is looked for anew, the worst frame first."""
    tried = np.zeros(len(shelves), bool)
    for _ in range(1 + len(shelves) // CHANCE_SPACING):
        misfit = np.array([min(candidate.energy for candidate in shelf) for shelf in shelves])
        worst = int(np.argmax(np.where(tried, -np.inf, misfit)))
        if tried[worst] or misfit[worst] <= POOR * np.median(misfit):
            return
        tried[worst] = True
        coarse = surface_cloud(sequence.mesh(sequence.numbers[worst]), own_from_capture, cell=COARSE)
        after, before = min(worst + CHANCE_SPACING, len(shelves)), max(worst - CHANCE_SPACING, -1)
        ways = range(worst, after), range(worst - 1, before, -1)
        _follow(search, list(product(_start(search, coarse, worst), ways)), shelves)


def _best_way(shelves: list[list[_Candidate]], yaw: FloatArray | None) -> list[_Candidate]:
    """One candidate a frame: small misfit, small turns (Viterbi)."""
    costs = [np.array([candidate.energy for candidate in shelf]) / ENERGY_SCALE for shelf in shelves]
    sides = [np.array([candidate.across for candidate in shelf]) for shelf in shelves]
    if yaw is not None:
        given = np.column_stack([np.sin(yaw), -np.cos(yaw), np.zeros(len(yaw))])
        costs = [
            cost + ((side - right) ** 2).sum(-1) / OTHERWISE_SCALE**2
            for cost, side, right in zip(costs, sides, given, strict=True)
        ]
    total, back = costs[0], []
    for before, cost, side in zip(sides, costs[1:], sides[1:], strict=False):
        step = ((side[:, None] - before[None]) ** 2).sum(-1) / TURN_SCALE**2
        back.append(np.argmin(total[None] + step, axis=1))
        total = cost + np.min(total[None] + step, axis=1)
    choice = [int(np.argmin(total))]
    for step_back in reversed(back):
        choice.append(int(step_back[choice[-1]]))
    return [shelf[at] for shelf, at in zip(shelves, reversed(choice), strict=True)]


def _in_capture(model: BodyModel, numbers: IntArray, way: list[_Candidate], own_from_capture: FloatArray) -> BodyTrack:
    """The chosen poses, taken back to the capture's frame."""
    capture_from_own = invert(own_from_capture)
    turn = rotation_from_vector(np.array([0.0, 0.0, capture_from_own[2]]))
    places = np.array([joint_places(model, candidate.pose) for candidate in way])
    rotations = np.array([turn @ candidate.pose.rotations for candidate in way])
    shape = np.array([candidate.pose.shape for candidate in way])
    misfit = np.array([candidate.energy for candidate in way])
    return BodyTrack(numbers, apply_pose(capture_from_own, places), rotations, misfit, shape)
