"""The kernels that take longest to compile, and those that are needed last, called on next to nothing.

Their arguments have the types that the work calls them with, so that what is compiled for them is what it needs. They
come in an order in which the work, which compiles what comes before them, finds most of them ready when it gets there.
"""

import os
import sys
from collections.abc import Callable
from threading import Thread
from typing import Final

import numpy as np

from mhvedit.geometry.winding import winding_numbers
from mhvedit.optimise.keys import best_placements
from mhvedit.optimise.stages import KeySegment, stages_of
from mhvedit.scene.edges import closest_between_edges
from mhvedit.scene.shells import cells_of, shell_of, stacked, touching
from mhvedit.scene.surfaces import points_of_large_faces
from mhvedit.search.groups import described, located_solutions
from mhvedit.search.listing import listed, reasons_listed
from mhvedit.search.meet import meets
from mhvedit.search.poses import pose_grid
from mhvedit.search.pyramid import SLABS, TOP, Pools, Pyramid, TurnedPyramid
from mhvedit.search.solve import BASE_REASONS, map_by_yaw
from mhvedit.sequences.meshes import Mesh

PITCH: Final = 0.01  # m
PATIENT: Final = 10  # how much less urgent this is than what a user waits for
PYRAMID: Final = Mesh(
    np.vstack([np.eye(3), np.zeros(3)]), np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], np.int32)
)


def _meet() -> None:
    """Two volumes of nothing."""
    words, columns = np.zeros((1, SLABS), np.uint64), np.zeros((1, 1), np.int32)
    first, shape = np.zeros(TOP + 1, np.int64), np.zeros((TOP + 1, 2), np.int64)
    pools = Pools(words, np.zeros(1, np.int32), first, shape)
    a = Pyramid(columns, words, words, 1, 1, pools, pools, pools, shape)
    b = TurnedPyramid(columns, words, words, pools, pools, shape)
    meets(a, b, base=np.zeros(2, np.int64), stride=1, asked=np.ones((1, 1), np.bool_))


def _list() -> None:
    """A grid of which all poses are solutions, and one of them."""
    grid = pose_grid(np.zeros(2), np.zeros(2), pitch=PITCH, stride=1, n_yaw=2, window=PITCH)
    found = map_by_yaw(grid, np.zeros((2, grid.size, grid.size), np.uint8), BASE_REASONS)
    cells, region, clearance = located_solutions(found, lever=1.0)
    cells = cells[:1]
    described(grid, cells, region[:1], clearance[:1], facing=(0.0, 0.0))
    cells.flags.writeable = False  # as what is read of a file
    for column in listed(grid, cells, facing=(0.0, 0.0), left=np.zeros(3), right=np.zeros(3)).values():
        column.fill(0, np.empty(1))
    reasons_listed(found).fill(0, np.empty(found.reason.shape, np.uint8))


def _measure() -> None:
    """A mesh and itself; what is needed last comes first, since the work is about to get here."""
    edges = PYRAMID.vertices[PYRAMID.faces[:, :2]]
    closest_between_edges(edges, edges, below=1.0)
    winding_numbers(PYRAMID.vertices, PYRAMID.faces, PYRAMID.vertices)
    shells, at_first = stacked([shell_of(PYRAMID)]), np.zeros(1, np.int64)
    touching(shells, cells_of(shells), frames=(at_first, at_first), relative=np.zeros((1, 3)))
    points_of_large_faces(PYRAMID.vertices, PYRAMID.faces, spacing=0.5)


def _choose() -> None:
    """Two segments with a solution each, which is not the same."""
    segments = [
        KeySegment(
            str(x), np.array([[x, 0, 0]]), np.array([[x * PITCH, 0.0, 0.0]]), np.zeros(1), np.zeros(2), np.ones(2)
        )
        for x in range(2)
    ]
    best_placements(stages_of(segments, [False]), facing_weight=1.0, step=PITCH, n_yaw=4)


EXAMPLES: Final[tuple[Callable[[], None], ...]] = (_meet, _list, _measure, _choose)


def compile_examples() -> None:
    """Call all, one after the other."""
    for example in EXAMPLES:
        example()


def main() -> None:
    """What the second process does: it lets the first one go before it, and ends with it."""
    if hasattr(os, "nice"):
        os.nice(PATIENT)
    Thread(target=_end_with_input, daemon=True).start()
    compile_examples()


def _end_with_input() -> None:
    """End the process when whoever holds the other end of its input does, however that comes about."""
    sys.stdin.read()
    os._exit(0)
