"""One key segment and all its solutions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.stages import Pair, Progress, Stages, found_by, grid_of, group_of, segment_stages, volumes_of
from mhvedit.pipeline.store import Arrays, Store, entry_name
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.groups import SolutionGroup, described
from mhvedit.search.poses import CellSet, PoseGrid
from mhvedit.search.solve import ACCEPTED, BASE_REASONS, ReasonMap
from mhvedit.sequences.segments import SegmentPair

SUMMARY = ("reasons", "counts", "n_regions")  # of a group, as it is kept
COLUMNS = ("cells", "region", "clearance", "penalty")


@dataclass(frozen=True, eq=False)  # no slots: what is large is fetched when it is first asked for
class SolvedSegment:
    """A key segment and all its solutions; canonical frames throughout."""

    spec: SegmentSpec
    grid: PoseGrid
    counts: Mapping[str, int]  # poses of the grid by what accepted or first rejected them
    n_regions: int  # connected regions of solutions
    stages: Stages  # where the large things come from
    made: ReasonMap | None = None  # `found`, where it has just been made; None where it is fetched
    quality: bool = True  # whether merit counts the quality of the contact

    @property
    def name(self) -> str:
        """As in the scene file."""
        return self.spec.name

    @property
    def identity(self) -> str:
        """Changes when anything does that the solutions depend on."""
        return entry_name(self.stages.of_group)

    @property
    def pair(self) -> SegmentPair:
        """The frames of both subjects."""
        return self.stages.pair

    @property
    def facing(self) -> tuple[float, float]:
        """Of A and B, rad."""
        return self.stages.facing

    @property
    def n_solutions(self) -> int:
        """How many there are."""
        return self.counts[BASE_REASONS[ACCEPTED]]

    @cached_property
    def found(self) -> ReasonMap:
        """What accepted or first rejected each pose of the grid."""
        return found_by(self.stages, self.grid) if self.made is None else self.made

    @cached_property
    def cells(self) -> IntArray:
        """(S,) where each solution is in the flattened grid, ascending."""
        return np.asarray(self._columns("cells")["cells"])

    @property
    def places(self) -> CellSet:
        """Where each solution is."""
        return CellSet(self.cells, self.grid.size, self.grid.base)

    @property
    def region(self) -> Int32Array:
        """(S,) as in `SolutionGroup`."""
        return np.asarray(self._columns("region")["region"])

    @property
    def clearance(self) -> FloatArray:
        """(S,) m, as in `SolutionGroup`."""
        return np.asarray(self._columns("clearance")["clearance"])

    @property
    def penalties(self) -> FloatArray:
        """(S,) as `penalty`, or (1,) where all have the same."""
        return np.asarray(self._columns("penalty")["penalty"])

    @cached_property
    def penalty(self) -> FloatArray:
        """(S,) what the contact's quality speaks against each solution, m."""
        return np.broadcast_to(self.penalties, self.n_solutions)

    @cached_property
    def group(self) -> SolutionGroup:
        """All solutions."""
        return self.rows(np.arange(self.n_solutions))

    def rows(self, rows: IntArray) -> SolutionGroup:
        """Some of the solutions.

        Args:
            rows: (N,) of the group.
        """
        return described(self.grid, self.cells[rows], self.region[rows], self.clearance[rows], facing=self.facing)

    def rows_at(self, keys: IntArray) -> IntArray:
        """Rows of lattice poses, -1 for those that are no solutions.

        Args:
            keys: (N, 3) as in `SolutionGroup`.
        """
        return self.places.rows_at(keys)

    def merit(self, rows: IntArray) -> FloatArray:
        """(N,) m: clearance less what the contact's quality speaks against each solution.

        Args:
            rows: (N,) of the group.
        """
        clearance = self.clearance[rows]
        return clearance - self.penalty[rows] if self.quality else clearance

    def keys(self, rows: IntArray) -> IntArray:
        """(N, 3) lattice poses of solutions.

        Args:
            rows: (N,) of the group.
        """
        return self.places.keys(rows)

    def kept(self) -> "SolvedSegment":
        """The segment without the large things that were just made: they are kept, and fetched when asked for."""
        return self if self.made is None else replace(self, made=None)

    def volumes(self) -> Pair:
        """Both subjects' volumes."""
        return volumes_of(self.stages)

    def _columns(self, *names: str) -> Arrays:
        return group_of(self.stages, self.grid, *names)


def solve_segment(
    scene: SceneFile,
    spec: SegmentSpec,
    people: Mapping[str, Person],
    *,
    fps: float,
    store: Store,
    workers: int,
    progress: Progress | None = None,
) -> SolvedSegment:
    """Find every placement in which a segment's interaction really happens.

    Args:
        scene: the scene file.
        spec: the segment.
        people: by name.
        fps: of the scene.
        store: where results are kept between runs.
        workers: threads.
        progress: told the share of the search that is done.
    """
    stages = segment_stages(scene, spec, people, fps=fps, store=store, workers=workers)
    grid = grid_of(stages)
    made: list[ReasonMap] = []
    told = group_of(stages, grid, *SUMMARY, *COLUMNS, progress=progress, made=made.append)  # damage is found here
    counts = dict(zip(told["reasons"].tolist(), told["counts"].tolist(), strict=True))
    return SolvedSegment(spec, grid, counts, int(told["n_regions"]), stages, made[0] if made else None)
