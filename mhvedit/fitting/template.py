"""The subject's own surface in one frame, bound to its joints: the shape with which every other frame is compared."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from mhvedit.fitting.joints import NAMES, TURNS, joint, places_in, turns_in
from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray
from mhvedit.sequences.bodies import BodyTrack
from mhvedit.sequences.body_fit import WRONG_SIDE
from mhvedit.sequences.body_model import LEFT_ELBOW, RIGHT_ELBOW, BodyModel, plain_adult
from mhvedit.sequences.meshes import Mesh

SPREAD: Final = 0.06  # m, over which the skin passes from one bone to the next
FAINT: Final = 0.02  # share below which a bone does not carry a point
CARRIERS: Final = 4  # bones that carry a point at most
N_SAMPLES: Final = 700  # points of the surface that are compared
SHOULDERS: Final = 4  # the plain adult's cone from shoulder to shoulder, the left end first ...
OUTER: Final = 0.3  # ... and the share of it at either end that goes with the collar bone
CHUNK: Final = 20000  # points that are looked at at once


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A surface bound to the joints inside it; the bind frame is the capture's frame `number`."""

    number: int  # frame
    vertices: FloatArray  # (V, 3) m
    normals: FloatArray  # (V, 3) unit, outwards
    faces: Int32Array  # (F, 3)
    weights: FloatArray  # (V, J) sums of 1
    rest: FloatArray  # (J, 3) m, joints
    axes: FloatArray  # (J, 3, 3) axes of the joints there: front, left, up of a standing body in the columns
    samples: IntArray  # (N,) vertices that are compared


def bind(mesh: Mesh, track: BodyTrack, at: int) -> Template:
    """Bind one frame of a capture to the joints that the plain adult has there.

    Args:
        mesh: that frame.
        track: the plain adult in the capture.
        at: index of the frame in the track.
    """
    normals, areas = outward_normals(mesh)
    weights = bone_weights(mesh, normals, track, at)
    samples = _spread_samples(areas, N_SAMPLES)
    rest, axes = places_in(track)[at], turns_in(track)[at]
    return Template(int(track.numbers[at]), mesh.vertices, normals, mesh.faces, weights, rest, axes, samples)


def outward_normals(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Unit normals (V, 3) of a mesh, turned outwards, and the area (V,) m^2 that belongs to each vertex."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals, areas = np.zeros_like(mesh.vertices), np.zeros(len(mesh.vertices))
    for k in range(3):
        np.add.at(normals, mesh.faces[:, k], across)
        np.add.at(areas, mesh.faces[:, k], np.linalg.norm(across, axis=1) / 6.0)
    inside_out = float((across * (a - mesh.vertices.mean(0))).sum()) < 0
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray((-normals if inside_out else normals) / np.maximum(length, 1e-12)), areas


def bone_weights(mesh: Mesh, normals: FloatArray, track: BodyTrack, at: int) -> FloatArray:
    """Weights (V, J): the bone of the round cone that explains a vertex best, smoothed along the surface."""
    weights = np.eye(len(NAMES))[_nearest_bones(mesh.vertices, normals, track, at)]
    passing, edge = _neighbours(mesh)
    for _ in range(round((SPREAD / edge) ** 2)):
        weights = 0.5 * (weights + passing @ weights)
    weights[weights < FAINT] = 0.0
    return np.asarray(weights / weights.sum(1, keepdims=True))


def carriers(weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """(V, CARRIERS) the bones that carry each vertex most, and their shares, made to add up to 1."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :CARRIERS]
    shares = np.take_along_axis(weights, bones, axis=1)
    return np.ascontiguousarray(bones), np.ascontiguousarray(shares / shares.sum(1, keepdims=True))


def _neighbours(mesh: Mesh) -> tuple[csr_array, float]:
    """The mean over each vertex's neighbours as a matrix (V, V), and the mean length of an edge, m."""
    ends = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = (len(mesh.vertices), len(mesh.vertices))
    joined = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), size).tocsr()
    joined = ((joined + joined.T) > 0).astype(np.float64)
    lonely = diags_array((joined.sum(1) == 0).astype(np.float64))
    joined = (joined + lonely).tocsr()
    mean = diags_array(1.0 / joined.sum(1)) @ joined
    edge = float(np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1).mean())
    return mean, max(edge, 1e-3)


def _nearest_bones(points: FloatArray, normals: FloatArray, track: BodyTrack, at: int) -> IntArray:
    """Which fitted joint's bone each point is on."""
    model = plain_adult()
    pieces = np.array_split(np.arange(len(points)), len(points) // CHUNK + 1)
    found = [nearest_cones(points[piece], normals[piece], model, track, at) for piece in pieces]
    cone, along = (np.concatenate([each[k] for each in found]) for k in (0, 1))
    bones = _bones_of_cones(model)[cone.astype(np.int64)]
    shoulders = cone == SHOULDERS
    bones[shoulders & (along < OUTER)] = joint("left_clavicle")
    bones[shoulders & (along > 1.0 - OUTER)] = joint("right_clavicle")
    return np.asarray(bones)


def nearest_cones(
    points: FloatArray, normals: FloatArray, model: BodyModel, track: BodyTrack, at: int
) -> tuple[IntArray, FloatArray, FloatArray]:
    """The cone of the plain adult that explains each point best.

    Args:
        points: (N, 3) m.
        normals: (N, 3) unit.
        model: the plain adult.
        track: where it is.
        at: index of the frame in the track.

    Returns:
        (N,) cones, (N,) places along their axes from 0 to 1, and (N,) m misfits, in which a wrong direction counts as
        distance.
    """
    grown, stout = np.exp(track.shape[at, 0]), np.exp(track.shape[at].sum())
    turned = np.einsum("cij,cej->cei", track.rotations[at, model.cone_joint], model.cone_ends)
    ends = track.places[at, model.cone_joint][:, None] + grown * turned
    axis = ends[:, 1] - ends[:, 0]
    along = ((points[:, None] - ends[None, :, 0]) * axis).sum(-1) / np.maximum((axis**2).sum(-1), 1e-12)
    along = along.clip(0.0, 1.0)
    away = points[:, None] - (ends[None, :, 0] + along[..., None] * axis)
    far = np.linalg.norm(away, axis=-1)
    gap = far - stout * (model.cone_radii[:, 0] + along * (model.cone_radii[:, 1] - model.cone_radii[:, 0]))
    facing = (normals[:, None] * away).sum(-1) / np.maximum(far, 1e-9)
    misfit = np.hypot(gap, WRONG_SIDE * (1.0 - facing))
    cone, rows = misfit.argmin(1), np.arange(len(points))
    return cone, along[rows, cone], misfit[rows, cone]


def _bones_of_cones(model: BodyModel) -> IntArray:
    """(C,) the fitted joint that moves each cone: the first that turns like it; an elbow's second one is the hand."""
    bones = np.array([int(np.flatnonzero(TURNS == plain)[0]) for plain in model.cone_joint])
    for elbow in (LEFT_ELBOW, RIGHT_ELBOW):
        bones[np.flatnonzero(model.cone_joint == elbow)[1]] += 1
    return bones


def _spread_samples(areas: FloatArray, n: int) -> IntArray:
    """About n vertices that stand for equal areas."""
    passed = np.cumsum(areas) / max(float(areas.sum()), 1e-12)
    return np.unique(np.searchsorted(passed, (np.arange(n) + 0.5) / n).clip(0, len(areas) - 1))
