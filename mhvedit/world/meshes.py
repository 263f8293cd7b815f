"""A world as meshes, for pictures and files."""

from collections.abc import Sequence

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.meshes import Mesh
from mhvedit.world.pieces import Piece, surface
from mhvedit.world.world import State, World


def body_mesh(world: World, state: State, name: str) -> Mesh:
    """The convex pieces of a body where it is.

    Args:
        world: of the body.
        state: where everything is.
        name: of the body.
    """
    i = [body.name for body in world.bodies].index(name)
    pieces = world.bodies[i].pieces
    return _mesh(pieces, [i] * len(pieces), state)


def figure_mesh(world: World, state: State) -> Mesh:
    """The convex pieces of the figure where they are."""
    assert world.figure is not None
    return _mesh(world.figure.pieces, (len(world.bodies) + world.figure.joint).tolist(), state)


def _mesh(pieces: Sequence[Piece], frames: Sequence[int], state: State) -> Mesh:
    """Pieces as one mesh."""
    vertices, faces, count = list[FloatArray](), [], 0
    for piece, frame in zip(pieces, frames, strict=True):
        points, triangles = surface(piece)
        vertices.append(points @ state.moving.rotations[frame].T + state.moving.positions[frame])
        faces.append(triangles + count)
        count += len(points)
    return Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))
