"""The paper's scenes of an avatar in a gallery of 20 objects: walls, itself, a corner (Schmidl and Lin, table 2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.world.bodies import Body, BodyClass, Pose, body_of_pieces
from mhvedit.world.figure import load_avatar
from mhvedit.world.materials import Materials, load_materials
from mhvedit.world.pieces import box
from mhvedit.world.world import Tracked, World

FPS: Final = 60.0
N_FRAMES: Final = 600
Corners = tuple[tuple[float, float, float], tuple[float, float, float]]  # m, low and high, of a box
Angles = Mapping[str, float]  # degrees, for the root's slides m, by DOF


@dataclass(frozen=True, slots=True, eq=False)
class WorldScene:
    """A world, where it begins, and what the tracker says in each frame."""

    name: str
    world: World
    poses: Mapping[str, Pose]  # of all bodies, at the start
    tracked: tuple[Tracked, ...]  # T
    fps: float  # Hz


def avatar_scene(name: str, *, n_frames: int = N_FRAMES) -> WorldScene:
    """One of the paper's scenes of an avatar.

    Args:
        name: of AVATAR_SCENES.
        n_frames: in which the same motion is run through.
    """
    figure, materials = load_avatar(), load_materials()
    q = played([posture(figure.skeleton, angles) for angles in AVATAR_SCENES[name]], n_frames)
    bodies = gallery(materials)
    tracked = tuple(Tracked(posture=each) for each in q)
    return WorldScene(name, World(bodies, materials, figure), as_made(bodies), tracked, FPS)


def as_made(bodies: Sequence[Body]) -> dict[str, Pose]:
    """Bodies that stand where they were made."""
    return {body.name: Pose(np.eye(3), np.zeros(3)) for body in bodies}


def gallery(materials: Materials) -> tuple[Body, ...]:
    """The paper's environment of about 20 objects: two rooms with a floor, walls, tables, pillars and pedestals."""
    rows: list[tuple[str, list[Corners]]] = [
        ("floor", [((-4, -4, -0.3), (4, 8, -0.03))]),
        ("wall_front", [((-4, -1.4, 0), (4, -0.8, 3))]),
        ("wall_left", [((0.75, -0.8, 0), (1.25, 3, 3))]),
        ("wall_right", [((-4.4, -0.8, 0), (-4, 8, 3))]),
        ("wall_back", [((-4, 8, 0), (4, 8.4, 3))]),
        (
            "wall_between",
            [((-4, 3.0, 0), (-1.5, 3.2, 3)), ((-0.5, 3.0, 0), (1.25, 3.2, 3)), ((-1.5, 3, 2.1), (-0.5, 3.2, 3))],
        ),
        ("table", _table((-2.2, 1.2), (0.8, 0.5), 0.75)),
        ("table_low", _table((-2.4, 5.0), (0.6, 0.6), 0.45)),
        ("bench", _table((-3.0, 6.5), (1.0, 0.3), 0.45)),
        ("stairs", [((2, 6, 0), (3, 6.3, 0.2)), ((2, 6.3, 0), (3, 6.6, 0.4)), ((2, 6.6, 0), (3, 6.9, 0.6))]),
    ]
    rows += [
        (f"pedestal_{i}", [((x - 0.2, y - 0.2, 0), (x + 0.2, y + 0.2, 1.0))])
        for i, (x, y) in enumerate([(-3.5, 0), (-3.5, 2), (-1, 7), (1, 7), (3.5, 4), (3.5, 5.5)])
    ]
    rows += [
        (f"pillar_{i}", [((x - 0.15, y - 0.15, 0), (x + 0.15, y + 0.15, 3))])
        for i, (x, y) in enumerate([(-2, 4), (0.5, 4), (-2, 6), (0.5, 6)])
    ]
    return tuple(
        body_of_pieces(
            name, [box(np.array(low), np.array(high)) for low, high in parts], materials,
            kind=BodyClass.FIXED, material="wood",
        )
        for name, parts in sorted(rows)
    )  # fmt: skip


def posture(skeleton: Skeleton, angles: Angles) -> FloatArray:
    """(D,) rad or m; DOFs that are not named are 0."""
    q = np.zeros(skeleton.n_dofs)
    for name, value in angles.items():
        dof = skeleton.dof_names.index(name)
        q[dof] = value if skeleton.dof_slides[dof] else np.radians(value)
    return q


def played(keys: Sequence[FloatArray], n_frames: int) -> FloatArray:
    """(T, D) postures one after the other, without overshooting."""
    times = np.linspace(0.0, 1.0, len(keys))
    return np.asarray(PchipInterpolator(times, np.array(keys), axis=0)(np.linspace(0.0, 1.0, n_frames)))


def _table(middle: tuple[float, float], half: tuple[float, float], height: float) -> list[Corners]:
    """A top and four legs."""
    (x, y), (a, b) = middle, half
    legs = [(x + i * (a - 0.05), y + j * (b - 0.05)) for i in (-1, 1) for j in (-1, 1)]
    return [((x - a, y - b, height - 0.05), (x + a, y + b, height))] + [
        ((i - 0.03, j - 0.03, 0), (i + 0.03, j + 0.03, height - 0.05)) for i, j in legs
    ]


_HANGING: Final = {"left_upper_arm.y": 75.0, "right_upper_arm.y": -75.0}
_AHEAD: Final = {
    "left_upper_arm.z": -85.0, "left_forearm.z": -15.0, "right_upper_arm.z": 85.0, "right_forearm.z": 15.0,
}  # fmt: skip
_LEG_UP: Final = {"left_thigh.x": -75.0, "left_shin.x": 55.0}


def _pushes(posed: Angles, deepest: float) -> list[Angles]:
    """Three pushes into the wall in front, as in the paper's figure 8."""
    near = {"pelvis.ty": 0.1, **posed}
    into = {"pelvis.ty": -deepest, **posed}
    return [{"pelvis.ty": 0.3, **_HANGING}, near, into, near, into, near, into, near, {"pelvis.ty": 0.3, **_HANGING}]


def _crossings() -> list[Angles]:
    """Forearms through each other, hands into the belly."""
    ahead = {"left_upper_arm.z": -80.0, "right_upper_arm.z": 80.0, "left_forearm.z": -30.0, "right_forearm.z": 30.0}
    crossed = {"left_upper_arm.z": -120.0, "right_upper_arm.z": 120.0, "left_forearm.z": -40.0, "right_forearm.z": 40.0}
    left_in, right_in = {**ahead, "left_upper_arm.z": -125.0}, {**ahead, "right_upper_arm.z": 125.0}
    folded = {
        "left_upper_arm.y": 60.0,
        "left_upper_arm.z": -50.0,
        "right_upper_arm.y": -60.0,
        "right_upper_arm.z": 50.0,
    }
    belly = {**folded, "left_forearm.z": -125.0, "right_forearm.z": 125.0}
    start = {"pelvis.ty": 0.8}
    return [
        {**start, **each}
        for each in (_HANGING, ahead, left_in, ahead, right_in, ahead, crossed, ahead, folded, belly, _HANGING)
    ]


def _into_corner() -> list[Angles]:
    """The left arm goes into the corner of two walls, along both and out again."""
    side, front = {"left_upper_arm.z": -10.0}, {"left_upper_arm.z": -75.0}
    corner = {"left_upper_arm.z": -40.0, "left_forearm.z": -10.0}
    down = {"right_upper_arm.y": -75.0}
    return [
        {"pelvis.ty": ty, "pelvis.tx": tx, **down, **arm}
        for tx, ty, arm in (
            (-0.3, 0.3, _HANGING), (0.15, 0.1, side), (0.25, -0.15, corner), (0.3, -0.2, front), (0.3, -0.2, corner),
            (0.35, -0.25, side), (0.3, -0.25, corner), (0.1, 0.1, front), (-0.3, 0.3, _HANGING),
        )
    ]  # fmt: skip


AVATAR_SCENES: Final[Mapping[str, list[Angles]]] = {
    "two arms": _pushes(_AHEAD, 0.3),
    "self-collision": _crossings(),
    "two arms and leg": _pushes({**_AHEAD, **_LEG_UP}, 0.3),
    "arm in corner": _into_corner(),
}
