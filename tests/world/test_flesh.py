"""Captured bodies as solids that move, and balls that stop rolling."""

import numpy as np
import pytest
import trimesh

from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.meshes import Mesh
from mhvedit.world.among import Among, Crowd
from mhvedit.world.balls import RESISTANCE, as_ball
from mhvedit.world.bodies import BodyClass, Pose, body_of_pieces
from mhvedit.world.flesh import CELL, NO_FLESH, flesh_near
from mhvedit.world.pieces import hull
from mhvedit.world.world import World
from tests.world.things import MATERIALS, at, floor

EVERYWHERE = np.array([[[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]]])


def limb(offset: FloatArray, *, sections: int = 24) -> Mesh:
    """A slim, closed body, of another connectivity with every number of sections."""
    shape = trimesh.creation.capsule(height=0.3, radius=0.05, count=(sections, sections))
    return Mesh(np.asarray(shape.vertices) + offset, np.asarray(shape.faces, np.int32))


def nobody(boxes: FloatArray) -> Crowd:
    return Crowd((), (), ())


@pytest.mark.parametrize("way", [(0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (0.08, -0.05, 0.0)])
def test_solids_come_from_where_the_body_was(way: tuple[float, float, float]) -> None:
    before, after = limb(np.zeros(3), sections=20), limb(np.array(way), sections=26)
    flesh = flesh_near(after, EVERYWHERE, before=before)
    across = flesh.shifts[:, :2]
    np.testing.assert_allclose(np.median(across, axis=0), way[:2], atol=2e-3)
    np.testing.assert_allclose(across, np.tile(way[:2], (len(across), 1)), atol=0.015)


def test_solids_fill_the_body_and_little_else() -> None:
    mesh = limb(np.array([0.011, 0.027, 0.3]))
    flesh = flesh_near(mesh, EVERYWHERE, before=None)
    corners = np.concatenate([p.points + m for p, m in zip(flesh.pieces, flesh.middles, strict=True)])
    axis = np.clip(corners[:, 2] - 0.3, -0.15, 0.15)
    away = np.linalg.norm(corners - np.stack([0 * axis + 0.011, 0 * axis + 0.027, 0.3 + axis], 1), axis=1)
    assert away.max() < 0.0501
    solids = [trimesh.convex.convex_hull(p.points + m) for p, m in zip(flesh.pieces, flesh.middles, strict=True)]
    inside = np.asarray(mesh.vertices) * 0.999 + 0.001 * mesh.vertices.mean(0)
    held = np.any([trimesh.proximity.signed_distance(solid, inside) > -1e-3 for solid in solids], axis=0)
    assert held.all()


def test_only_what_is_near() -> None:
    mesh = limb(np.zeros(3))
    box = np.array([[[-0.2, -0.2, 0.1], [0.2, 0.2, 0.3]]])
    flesh = flesh_near(mesh, box, before=None)
    assert flesh.middles[:, 2].min() > 0.1 - CELL and len(flesh.pieces)
    assert flesh_near(mesh, box + 3.0, before=None) is NO_FLESH


def test_a_ball_is_told_from_other_round_things() -> None:
    ball = trimesh.creation.icosphere(2, 0.12)
    found = as_ball(np.asarray(ball.vertices) + 0.4, ball.faces)
    assert found is not None and found.radius == pytest.approx(0.12)
    np.testing.assert_allclose(found.points, 0.4 * np.ones((1, 3)), atol=1e-9)
    cube, egg = trimesh.creation.box((1, 1, 1)), np.asarray(ball.vertices) * [1, 1, 1.1]
    assert as_ball(np.asarray(cube.vertices), cube.faces) is None
    assert as_ball(egg, ball.faces) is None


def test_rolling_slows_down_by_its_resistance() -> None:
    shape = trimesh.creation.icosphere(3, 0.1)
    piece = as_ball(np.asarray(shape.vertices), shape.faces)
    assert piece is not None
    ball = body_of_pieces("ball", [piece], MATERIALS, kind=BodyClass.SIMULATED, material="wood", mass=0.5)
    ramp = body_of_pieces(
        "push", [hull(np.asarray(trimesh.creation.box((0.1, 0.4, 0.4)).vertices))], MATERIALS,
        kind=BodyClass.DRIVEN, material="wood", mass=1.0,
    )  # fmt: skip
    among = Among(
        World((floor(), ball, ramp), MATERIALS), {"floor": at(0, 0, 0), "ball": at(0, 0, 0.1), "push": at(-0.2, 0, 0.3)}
    )
    among.begin(nobody)
    x = []
    for k in range(120):
        told = Pose(np.eye(3), np.array([-0.2 + 0.02 * min(k, 8), 0.0, 0.3]))
        x.append(among.step({"push": told}, nobody, 1 / 60).poses["ball"].position[0])
    speed = np.diff(x) * 60
    assert speed[40] > 0.3
    slowing = (speed[40] - speed[100]) / (60 / 60)
    assert slowing == pytest.approx(5 / 7 * RESISTANCE * 9.81, rel=0.05)
