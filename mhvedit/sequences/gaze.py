"""Where a person's eyes are and where they look: given by tracks, or found from the shape of the head.

The eyes themselves can't be seen in a mesh: the direction is the one the face points to.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from mhvedit.errors import SceneError
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.geometry.planar import invert
from mhvedit.geometry.smoothing import smoothed
from mhvedit.sequences.bodies import BodyTrack
from mhvedit.sequences.body_fit import BodyPose, fit_body
from mhvedit.sequences.body_model import EYES, NECK, SKULL, BodyModel, plain_head, rotation_from_vector
from mhvedit.sequences.facing import single_joint
from mhvedit.sequences.meshes import Gaze, JointTracks, Mesh, MeshSequence
from mhvedit.sequences.surface_cloud import surface_cloud

HEAD_CELL = 0.02  # m, cells of the head's cloud
HEAD_REACH = 0.15  # m at scale 1, what lies within it of the skull's centre is the head
FEWEST_POINTS = 20  # below, the head that came with the body is kept
GLANCES = np.radians((0.0, 30.0, -30.0))  # turns of the head from the body's fit, each tried
GLANCE_COST = 2e-5  # m^2 / rad^2, against turning the head away from the body's fit
HEAD_SIGMA = np.r_[np.full(4, 0.04), np.full(6, 0.025)]  # m, distances beyond which a point loses its say
SMOOTHING = 0.06  # s, standard deviation of the smoothing over time


def gaze_of_body(sequence: MeshSequence, body: BodyTrack, *, workers: int = 1) -> Gaze:
    """Midpoint of the eyes and the direction of the face in every frame.

    Args:
        sequence: the capture, in metres and z up.
        body: the body that was tracked in it.
        workers: threads; the result does not depend on it.
    """
    head = plain_head()
    with ThreadPoolExecutor(workers) as pool:
        seen = list(pool.map(lambda at: _look_at_head(sequence, head, body, at), range(len(body.numbers))))
    eye, front = np.array(seen).swapaxes(0, 1)
    if len(front) > 1:
        front = smoothed(front, SMOOTHING * sequence.fps)
    return Gaze(body.numbers, eye, front / np.linalg.norm(front, axis=1, keepdims=True))


def gaze_from_tracks(eye: JointTracks, target: JointTracks) -> Gaze:
    """The gaze from where the eyes are to where they look, in the frames that both tracks have.

    Args:
        eye: with the joint `eye`, or a single joint.
        target: with the joint `target`, or a single joint.

    Raises:
        SceneError: no such joint, no frame in common, or the two coincide or are missing in a frame.
    """
    numbers, in_eye, in_target = np.intersect1d(eye.numbers, target.numbers, return_indices=True)
    if not len(numbers):
        raise SceneError("track", "gaze", "frames in which both eye and target are given", "none")
    start = single_joint(eye, "eye")[in_eye]
    step = single_joint(target, "target")[in_target] - start
    length = np.linalg.norm(step, axis=1)
    bad = ~(length > 1e-9)
    if bad.any():
        found = f"none in frame {numbers[np.argmax(bad)]}"
        raise SceneError("track", "gaze", "an eye and a target elsewhere in every frame", found)
    return Gaze(numbers, start, step / length[:, None])


def _look_at_head(sequence: MeshSequence, model: BodyModel, body: BodyTrack, at: int) -> tuple[FloatArray, FloatArray]:
    """Eyes (3,) m and front (3,) of the head in one frame: the plain head laid into the surface around the skull."""
    mesh = sequence.mesh(sequence.numbers[at])
    size, axes = float(body.size[at]), body.head[at]
    skull = body.places[at, NECK] + size * axes @ SKULL
    start = BodyPose(axes[None], skull, np.array([np.log(size), 0.0]))
    yaw = float(np.arctan2(axes[1, 1], axes[0, 1])) if np.hypot(*axes[:2, 1]) > 0 else 0.0
    own_from_capture = invert(np.array([skull[0], skull[1], yaw]))
    capture_turn = rotation_from_vector(np.array([0.0, 0.0, yaw]))
    centre = np.array([0.0, 0.0, skull[2]])
    faces = _faces_near(mesh, skull, 1.2 * HEAD_REACH * size)
    cloud = surface_cloud(Mesh(mesh.vertices, faces), own_from_capture, cell=HEAD_CELL)
    cloud = cloud[np.linalg.norm(cloud[:, :3] - centre, axis=1) < HEAD_REACH * size]
    if len(cloud) < FEWEST_POINTS:
        return skull + size * axes @ EYES, axes[:, 0]
    cloud[:, 6] /= cloud[:, 6].sum()
    own = BodyPose(capture_turn.T @ start.rotations, centre, start.shape)
    best = _best_glance(model, cloud, own)
    eyes = best.pelvis + np.exp(best.shape[0]) * best.rotations[0] @ EYES
    return skull + capture_turn @ (eyes - centre), capture_turn @ best.rotations[0][:, 0]


def _best_glance(head: BodyModel, cloud: FloatArray, start: BodyPose) -> BodyPose:
    """The head's posture that fits best, begun from several turns about its own up axis."""
    found = []
    for glance in GLANCES:
        turned = start.rotations @ rotation_from_vector(np.array([0.0, 0.0, glance]))
        pose, energy = fit_body(head, cloud, BodyPose(turned, start.pelvis, start.shape), sigma=HEAD_SIGMA)
        cosine = float(np.clip(pose.rotations[0][:, 0] @ start.rotations[0][:, 0], -1.0, 1.0))
        found.append((energy + GLANCE_COST * np.arccos(cosine) ** 2, pose))
    return min(found, key=lambda one: one[0])[1]


def _faces_near(mesh: Mesh, centre: FloatArray, reach: float) -> Int32Array:
    """The faces with a corner within reach."""
    near = ((mesh.vertices - centre) ** 2).sum(1) < reach**2
    return np.asarray(mesh.faces[near[mesh.faces].any(1)], np.int32)
