"""What the editor decided: which solutions a pin and exclusions leave to choose from."""

from collections.abc import Mapping, Sequence

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert, rotation, wrap_angle
from mhvedit.optimise.stages import NoSolution
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.project.schema import Exclusion, SegmentSpec, Spot
from mhvedit.search.groups import SolutionGroup
from mhvedit.search.poses import PoseGrid

NEARLY = 1e-6  # m and rad, within which a rounded spot still is the one it was
Frames = tuple[FloatArray, FloatArray]  # (3,) capture_from_canonical of A and of B


class NothingLeft(NoSolution):
    """A segment has solutions, and the editor's decisions leave none of them."""

    def __init__(self, segment: str, why: str) -> None:
        super().__init__([segment])
        self.args = (f'"{segment}": {why}',)


def rows_left(spec: SegmentSpec, segment: SolvedSegment, people: Mapping[str, Person]) -> IntArray | None:
    """The solutions that the editor leaves: the pinned one alone, or all but those that are excluded.

    Args:
        spec: the segment as the scene file has it now.
        segment: solved.
        people: by name.

    Returns:
        (N,) rows of the solution group; None for all.

    Raises:
        NothingLeft: there are solutions, and none of them is left.
    """
    if segment.n_solutions == 0 or (spec.pin is None and not spec.exclude):
        return None
    group, grid, frames = segment.group, segment.grid, canonical_frames(segment, people)
    if spec.pin is not None:
        return np.array([_pinned(spec.name, canonical_spot(spec.pin, frames), group, grid)])
    rows = np.arange(len(group))
    for exclusion in spec.exclude:
        rows = rows[~is_excluded(exclusion, group, grid, frames=frames)[rows]]
    if not len(rows):
        raise NothingLeft(spec.name, f"`exclude` leaves none of its {len(group):,} solutions")
    return rows


def is_excluded(exclusion: Exclusion, group: SolutionGroup, grid: PoseGrid, *, frames: Frames) -> BoolArray:
    """(S,) which solutions an exclusion leaves out.

    Args:
        exclusion: of the segment.
        group: its solutions.
        grid: in which they were searched.
        frames: canonical frames of A and of B.
    """
    pose = canonical_spot(exclusion.at, frames)
    if exclusion.radius is None:
        near = nearest_row(pose, group, grid)
        if near is None:
            return np.zeros(len(group), np.bool_)
        return np.asarray(group.region == group.region[near])
    poses, root = group.poses, grid.root_b
    if exclusion.of_a:
        poses, pose, root = invert(poses), invert(pose), grid.root_a
    return (_apart(poses, pose, root) <= exclusion.radius + NEARLY) & (_turned(poses, pose) <= exclusion.turn + NEARLY)


def idle_exclusions(
    specs: Sequence[SegmentSpec], segments: Sequence[SolvedSegment], people: Mapping[str, Person]
) -> tuple[str, ...]:
    """Exclusions that leave nothing out, in sentences: most often the region that they mean is gone.

    Args:
        specs: the segments as the scene file has them now.
        segments: solved.
        people: by name.
    """
    return tuple(
        f'"{spec.name}": exclude[{i}] leaves out no solution: none is there any more'
        for spec, segment in zip(specs, segments, strict=True)
        for i, exclusion in enumerate(spec.exclude)
        if segment.n_solutions
        and not is_excluded(exclusion, segment.group, segment.grid, frames=canonical_frames(segment, people)).any()
    )


def nearest_row(pose: FloatArray, group: SolutionGroup, grid: PoseGrid) -> int | None:
    """The solution at a pose, or else the nearest within one step of place and of yaw; None where there is none.

    Args:
        pose: (3,) of B in A, canonical frames.
        group: the solutions.
        grid: in which they were searched.
    """
    if not len(group):
        return None
    away, turned = _apart(group.poses, pose, grid.root_b), _turned(group.poses, pose)
    near = (away <= grid.step + NEARLY) & (turned <= 2 * np.pi / grid.n_yaw + NEARLY)
    return int(np.argmin(np.where(near, away + turned, np.inf))) if near.any() else None


def canonical_frames(segment: SolvedSegment, people: Mapping[str, Person]) -> Frames:
    """The canonical frames of the two subjects of a segment."""
    a, b = segment.spec.between
    return people[a].pose, people[b].pose


def canonical_spot(spot: Spot, frames: Frames) -> FloatArray:
    """(3,) a spot of the scene file as a pose of B in A, canonical frames."""
    return compose(compose(invert(frames[0]), np.array([spot.x, spot.y, spot.yaw])), frames[1])


def _pinned(name: str, pose: FloatArray, group: SolutionGroup, grid: PoseGrid) -> int:
    row = nearest_row(pose, group, grid)
    if row is None:
        away, turned = _apart(group.poses, pose, grid.root_b), _turned(group.poses, pose)
        near = int(np.argmin(away + 0.5 * turned))
        where = f"{100 * away[near]:.0f} cm and {np.degrees(turned[near]):.0f} degrees away"
        raise NothingLeft(name, f"`pin` is no solution any more; the nearest is {where}")
    return row


def _apart(poses: FloatArray, pose: FloatArray, root: FloatArray) -> FloatArray:
    """(S,) how far a root is from where one pose puts it, m."""
    there = rotation(poses[:, 2]) @ root + poses[:, :2]
    return np.asarray(np.linalg.norm(there - (rotation(pose[2]) @ root + pose[:2]), axis=1))


def _turned(poses: FloatArray, pose: FloatArray) -> FloatArray:
    """(S,) rad between yaws."""
    return np.abs(wrap_angle(poses[:, 2] - pose[2]))
