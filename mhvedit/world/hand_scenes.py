"""The paper's scenes of a rigid hand: over a table, a ball snipped off it, and along a corner (C1.5, C5)."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from mhvedit.files import load_table
from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.avatar_scenes import FPS, N_FRAMES, WorldScene, as_made, gallery, played
from mhvedit.world.bodies import Body, BodyClass, Pose, body_of_pieces
from mhvedit.world.materials import PACKAGE, Materials, load_materials
from mhvedit.world.pieces import Piece, box, ellipsoid, sphere
from mhvedit.world.turning import turn
from mhvedit.world.world import Tracked, World

HAND_MASS: Final = 0.4  # kg, of a hand; critically damped by the paper's coupling
TABLE: Final = (-2.2, 1.2, 0.75)  # m, middle of the gallery's table and its height
BALL: Final = 0.03  # m
Keys = Sequence[tuple[float, float, float, float, float, float]]  # x, y, z m and a rotation vector in degrees


def load_hand(materials: Materials) -> Body:
    """The package's hand of 15 elliptical parts."""
    return body_of_pieces("hand", hand_pieces(), materials, kind=BodyClass.DRIVEN, material="human", mass=HAND_MASS)


def hand_pieces() -> list[Piece]:
    """Palm and fingers, joint to joint."""
    table = load_table(PACKAGE, "hand")
    pieces = [ellipsoid(np.zeros(3), np.diag(table["palm"]["half"]))]
    for finger in table["fingers"]:
        at, way = np.array(finger["base"]), np.array(finger["way"])
        way = way / np.linalg.norm(way)
        across = np.cross(way, [0.0, 0.0, 1.0])
        for length in finger["lengths"]:
            radius = finger["radius"]
            axes = np.array([(length / 2 + radius / 2) * way, radius * across, [0.0, 0.0, radius]])
            pieces.append(ellipsoid(at + way * length / 2, axes))
            at = at + way * length
    return pieces


def hand_scene(name: str, *, n_frames: int = N_FRAMES) -> WorldScene:
    """One of the paper's scenes of a hand.

    Args:
        name: of HAND_SCENES.
        n_frames: in which the same motion is run through.
    """
    materials = load_materials()
    ball = body_of_pieces("ball", [sphere(BALL)], materials, kind=BodyClass.SIMULATED, material="wood", mass=0.05)
    corner = body_of_pieces("corner", _corner(), materials, kind=BodyClass.FIXED, material="wood")
    bodies = (*gallery(materials), ball, corner, load_hand(materials))
    x, y, z = TABLE
    poses = {**as_made(bodies), "ball": Pose(np.eye(3), np.array([x + 0.3, y - 0.35, z + BALL + 1e-4]))}
    poses["corner"] = Pose(np.eye(3), np.array([2.0, 2.0, 0.0]))
    path = [_pose(each) for each in played([np.array(key) for key in HAND_SCENES[name]], n_frames)]
    poses["hand"] = path[0]
    tracked = tuple(Tracked({"hand": pose}) for pose in path)
    return WorldScene(name, World(bodies, materials), poses, tracked, FPS)


def _corner() -> list[Piece]:
    """Two walls that meet at the origin, one along x and one along y."""
    return [
        box(np.array([0, -0.3, 0]), np.array([1.5, 0, 2.5])),
        box(np.array([-0.3, -0.3, 0]), np.array([0, 1.5, 2.5])),
    ]


def _pose(key: FloatArray) -> Pose:
    """Of a key."""
    return Pose(turn(np.radians(key[3:])), key[:3].copy())


def _over_the_table() -> Keys:
    """Idle, twice over the table with the tracker in its top, then the fingers snip the ball off its edge."""
    x, y, z = TABLE
    high, low = z + 0.2, z - 0.02
    return [
        (x - 0.5, y, high, 0, 0, 0), (x - 0.3, y + 0.1, high, 0, 0, 0), (x - 0.4, y, high, 0, 0, 20),
        (x - 0.4, y, low, 0, 0, 0), (x, y, low, 0, 0, 0), (x + 0.3, y, low, 0, 0, 0), (x + 0.3, y, high, 0, 0, 0),
        (x + 0.3, y, low, 0, 0, 0), (x, y, low, 0, 0, 0), (x - 0.4, y, low, 0, 0, 0), (x - 0.4, y, high, 0, 0, 0),
        (x + 0.3, y - 0.1, high, 0, 0, 180), (x + 0.3, y - 0.1, z + 0.03, 0, 0, 180),
        (x + 0.3, y - 0.32, z + 0.03, 0, 0, 180), (x + 0.3, y - 0.2, high, 0, 0, 180), (x, y - 0.2, high, 0, 0, 180),
    ]  # fmt: skip


def _along_the_corner() -> Keys:
    """Into a wall, along it into the corner, pressed into both walls, and along the other."""
    c, z = 2.0, 1.2
    return [
        (c + 1.0, c + 0.4, z, 0, 0, 90), (c + 0.9, c - 0.02, z, 0, 0, 90), (c + 0.5, c - 0.02, z, 0, 0, 90),
        (c + 0.15, c - 0.02, z, 0, 0, 70), (c - 0.02, c - 0.02, z, 0, 0, 45), (c - 0.03, c - 0.03, z + 0.2, 0, 0, 45),
        (c - 0.02, c + 0.2, z, 0, 0, 20), (c - 0.02, c + 0.6, z, 0, 0, 0), (c + 0.4, c + 0.8, z, 0, 0, 0),
    ]  # fmt: skip


HAND_SCENES: Final[dict[str, Keys]] = {
    "hand on table": _over_the_table(),
    "hand along corner": _along_the_corner(),
}
