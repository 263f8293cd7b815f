"""From solution groups to one scene: the best chain, the time line, and the way between the key segments."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert, rotation, wrap_angle
from mhvedit.optimise.chains import Start
from mhvedit.optimise.company import CompanyPlacements, place_company
from mhvedit.optimise.stages import KeySegment, Stage, stages_of
from mhvedit.optimise.thinning import Places, near_best
from mhvedit.optimise.transitions import PathSettings, placement_path
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.terms import segment_key
from mhvedit.project.schema import OptimiseSettings, SceneFile
from mhvedit.scene.edit import EditedScene, SegmentEdit, SubjectEdit
from mhvedit.sequences.align import TimeLine, time_line


@dataclass(frozen=True, slots=True)
class Bend:
    """Frames between key segments in which people would have met, and give way to each other or to a prop."""

    between: tuple[str, str]
    first: int  # frame of the scene
    last: int
    before_mm: float  # how deep they would have been
    after_mm: float  # how deep they are
    allowed_mm: float
    moved_mm: float  # the furthest that anybody of them is shifted
    cost: float  # m^2, that the shifts of both add to the energy of their paths (see `optimise.bending`)


@dataclass(frozen=True, slots=True)
class Stop:
    """A run of frames in which somebody would be inside a prop."""

    subject: str
    prop: str
    first: int  # frame of the scene
    last: int
    before_mm: float  # how deep, as captured
    after_mm: float
    limbs: tuple[str, ...]  # that give way
    turned_deg: float  # the largest change of a joint
    joint: str  # and which; empty where nothing is changed
    why: str  # what is left and why; empty where nothing is


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """The edited scene, and how it came about."""

    scene: EditedScene
    line: TimeLine
    placements: CompanyPlacements
    chosen: tuple[int, ...]  # row of each segment's solution group
    bends: tuple[Bend, ...] = ()  # where paths give way
    stops: tuple[Stop, ...] = ()  # where limbs stop at fixed props
    notes: tuple[str, ...] = ()  # what could not be had, in sentences


def cast(scene: SceneFile) -> tuple[str, ...]:
    """Everybody, in the order in which the segments name them; those who are in none come last."""
    return tuple(dict.fromkeys([name for spec in scene.segments for name in spec.between] + list(scene.subjects)))


def lay_out(scene: SceneFile, people: Mapping[str, Person], fps: float) -> TimeLine:
    """The scene's time line."""
    keys = [segment_key(spec) for spec in scene.segments]
    numbers = {name: np.array(people[name].sequence.numbers) for name in cast(scene)}
    return time_line(keys, numbers, rates={name: fps / people[name].sequence.fps for name in numbers})


def assemble(
    scene: SceneFile,
    people: Mapping[str, Person],
    solved: Sequence[SolvedSegment],
    *,
    fps: float,
    rows: Sequence[IntArray | None] | None = None,
) -> Assembly:
    """Choose the best placements and carry everyone along them.

    Args:
        scene: the scene file.
        people: by name.
        solved: key segments, in order.
        fps: of the scene.
        rows: (N,) of each segment, the solutions to choose from; None for all, of one or of every segment.

    Raises:
        NoSolution: a segment has no solution, or adjoining ones have none in common.
    """
    line = lay_out(scene, people, fps)
    left: list[IntArray | None] = [None] * len(solved) if rows is None else list(rows)
    pairs, start = by_pair(solved), None
    for own in pairs:
        shared = shared_rows([solved[i] for i in own], [left[i] for i in own])
        if shared is None and len(pairs) == 1:
            shared, start = _near_rows(scene, solved, left, _joined(line, own))
        for i, some in zip(own, shared or [], strict=False):
            left[i] = some
    runs, stages = _stages(solved, left, line)
    search = scene.search
    placements = place_company(
        stages,
        [solved[run[0]].spec.between for run in runs],
        facing_weight=scene.optimise.facing_weight,
        step=search.step,
        n_yaw=search.n_yaw,
        start=start,
    )
    subjects = {name: _subject_edit(name, scene, people, solved, line, runs, placements) for name in cast(scene)}
    segments, chosen = _segment_edits(solved, line, runs, stages, placements, people)
    edited = EditedScene(
        name=scene.name,
        fps=fps,
        n_frames=line.n_frames,
        subjects=subjects,
        segments=segments,
        cost=placements.cost,
        lower_bound=placements.lower_bound,
        gap=placements.gap,
    )
    return Assembly(edited, line, placements, chosen)


def by_pair(solved: Sequence[SolvedSegment]) -> list[list[int]]:
    """Indices of the segments of each pair.

    Args:
        solved: key segments, in order.
    """
    pairs: dict[tuple[str, str], list[int]] = {}
    for i, segment in enumerate(solved):
        pairs.setdefault(segment.spec.between, []).append(i)
    return list(pairs.values())


def shared_rows(solved: Sequence[SolvedSegment], rows: Sequence[IntArray | None]) -> list[IntArray] | None:
    """The solutions that all segments share. A chain of these costs nothing, so no others need to be looked at.

    Args:
        solved: key segments.
        rows: (N,) of each segment, ascending, the solutions to choose from; None for all.

    Returns:
        Rows of each segment, one pose a row; None where the segments share none.
    """
    least, *others = sorted(zip(solved, rows, strict=True), key=lambda own: _count(*own))
    keys = least[0].keys(_listed(*least))
    for segment, some in others:
        at = segment.rows_at(keys)
        keys = keys[at >= 0] if some is None else keys[(at >= 0) & np.isin(at, some)]
    return [segment.rows_at(keys) for segment in solved] if len(keys) else None


def _count(segment: SolvedSegment, rows: IntArray | None) -> int:
    return segment.n_solutions if rows is None else len(rows)


def _listed(segment: SolvedSegment, rows: IntArray | None) -> IntArray:
    return np.arange(segment.n_solutions) if rows is None else rows


def _key_segment(segment: SolvedSegment, rows: IntArray) -> KeySegment:
    keys, grid = segment.keys(rows), segment.grid
    return KeySegment(segment.name, keys, grid.lattice_poses(keys), segment.merit(rows), grid.root_a, grid.root_b)


def _stages(
    solved: Sequence[SolvedSegment], rows: Sequence[IntArray | None], line: TimeLine
) -> tuple[list[tuple[int, ...]], list[Stage]]:
    """Segments of one pair that adjoin as stages: the indices of each one's segments, and what these have in common."""
    runs: list[tuple[int, ...]] = []
    stages: list[Stage] = []
    for own in by_pair(solved):
        keys = [_key_segment(solved[i], _listed(solved[i], rows[i])) for i in own]
        adjoins = _adjoins(line, own)
        runs += _joined(line, own)
        stages += stages_of(keys, adjoins)
    order = sorted(range(len(runs)), key=lambda g: runs[g])
    return [runs[g] for g in order], [stages[g] for g in order]


def _adjoins(line: TimeLine, own: Sequence[int]) -> list[bool]:
    """Of the segments of one pair, whether nothing lies between each and the next."""
    return [line.spans[i].stop == line.spans[j].start for i, j in pairwise(own)]


def _joined(line: TimeLine, own: Sequence[int]) -> list[tuple[int, ...]]:
    """Segments of one pair, those together that adjoin."""
    breaks = [0, *(n + 1 for n, joined in enumerate(_adjoins(line, own)) if not joined), len(own)]
    return [tuple(own[start:stop]) for start, stop in pairwise(breaks)]


def _near_rows(
    scene: SceneFile, solved: Sequence[SolvedSegment], rows: Sequence[IntArray | None], runs: Sequence[tuple[int, ...]]
) -> tuple[list[IntArray] | None, Start | None]:
    """The solutions of each segment of a pair that the best chain can be made of, None where there is no chain.

    And a good chain, where not all of them are left.
    """
    joined: list[list[IntArray | None]] = []
    for run in runs:
        if len(run) == 1:
            joined.append([rows[run[0]]])
            continue
        shared = shared_rows([solved[i] for i in run], [rows[i] for i in run])
        if shared is None:
            return None, None
        order = np.argsort(shared[0])
        joined.append([own[order] for own in shared])
    places = [_places([solved[i] for i in run], shared[0]) for run, shared in zip(runs, joined, strict=True)]
    if not all(map(len, places)):
        return None, None
    search = scene.search
    near = near_best(places, facing_weight=scene.optimise.facing_weight, step=search.step, n_yaw=search.n_yaw)
    pairs = [(own, some) for shared, some in zip(joined, near.rows, strict=True) for own in shared]
    return [some if own is None else own[some] for own, some in pairs], near.start


def _places(run: Sequence[SolvedSegment], rows: IntArray | None) -> Places:
    """Where some solutions are that adjoining segments share; rows of the first one, ascending."""
    places = run[0].places
    if rows is not None:
        places = replace(places, cells=places.cells[rows])
    grids = [segment.grid for segment in run]
    return Places(places, np.array([grid.root_a for grid in grids]), np.array([grid.root_b for grid in grids]))


def _subject_edit(
    name: str,
    scene: SceneFile,
    people: Mapping[str, Person],
    solved: Sequence[SolvedSegment],
    line: TimeLine,
    runs: Sequence[tuple[int, ...]],
    placed: CompanyPlacements,
) -> SubjectEdit:
    """One subject's frames and placements; its own motion is told in the gauge, in which it is to be kept."""
    person, source = people[name], line.sources[name]
    own = [g for g, run in enumerate(runs) if name in solved[run[0]].spec.between]
    if not own:
        return SubjectEdit(source, np.zeros((len(source), 3)))
    first = next(group[0] for group in placed.groups if own[0] in group)
    leader = solved[runs[first][0]].spec.between[0]
    world = people[leader].pose  # the leader's capture frame is the group's world
    placements = np.full((len(source), 3), np.nan)
    for g in own:
        side = placed.a if solved[runs[g][0]].spec.between[0] == name else placed.b
        for i in runs[g]:
            span = line.spans[i]
            placements[span.start : span.stop] = compose(compose(world, side[g]), invert(person.pose))
    gauge = placed.gauges[name] + world[2] - person.pose[2]
    turn = np.array([0.0, 0.0, gauge])
    kept_motion = compose(placements, invert(turn))
    facing = person.facing.yaw[np.searchsorted(person.facing.numbers, source)] + gauge
    centres = person.centres_at(source) @ rotation(gauge).T
    path = placement_path(kept_motion, centres=centres, facing=facing, settings=path_settings(scene.optimise))
    path = compose(path, turn)
    path[:, 2] = wrap_angle(path[:, 2])
    return SubjectEdit(source, path)


def path_settings(optimise: OptimiseSettings) -> PathSettings:
    """The weights of paths."""
    return PathSettings(
        acceleration=optimise.acceleration,
        alpha=optimise.alpha,
        slow_speed=optimise.slow_speed,
        slow_turn=optimise.slow_turn,
    )


def _segment_edits(
    solved: Sequence[SolvedSegment],
    line: TimeLine,
    runs: Sequence[tuple[int, ...]],
    stages: Sequence[Stage],
    placements: CompanyPlacements,
    people: Mapping[str, Person],
) -> tuple[tuple[SegmentEdit, ...], tuple[int, ...]]:
    stage_of = {i: g for g, run in enumerate(runs) for i in run}
    edits, rows = [], []
    for index, segment in enumerate(solved):
        g = stage_of[index]
        row = int(segment.rows_at(stages[g].keys[[placements.chosen[g]]])[0])
        chosen = segment.rows(np.array([row]))
        a, b = segment.spec.between
        edits.append(
            SegmentEdit(
                name=segment.spec.name,
                start=line.spans[index].start,
                stop=line.spans[index].stop,
                interaction=segment.spec.interaction.value,
                between=(a, b),
                distance=float(chosen.distance[0]),
                theta_a=float(chosen.theta_a[0]),
                theta_b=float(chosen.theta_b[0]),
                relative=captured_poses(chosen.poses, people[a], people[b])[0],
            )
        )
        rows.append(row)
    return tuple(edits), tuple(rows)


def captured_poses(poses: FloatArray, a: Person, b: Person) -> FloatArray:
    """Poses of B's capture frame in A's, from those of the canonical frames.

    Args:
        poses: (S, 3) canonical.
        a: first subject.
        b: second subject.

    Returns:
        (S, 3) x, y m and yaw rad in [-pi, pi).
    """
    turned = compose(compose(a.pose, poses), invert(b.pose))
    turned[:, 2] = wrap_angle(turned[:, 2])
    return turned
