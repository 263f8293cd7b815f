"""From solution groups to one scene: the best chain, the time line, and the way between the key segments."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert, rotation, wrap_angle
from mhvedit.optimise.keys import KeyPlacements, best_placements
from mhvedit.optimise.stages import KeySegment, Stage, stages_of
from mhvedit.optimise.transitions import PathSettings, placement_path
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.project.schema import OptimiseSettings, SceneFile
from mhvedit.scene.edit import EditedScene, SegmentEdit, SubjectEdit
from mhvedit.sequences.align import KeyRange, Stretch, time_line


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """The edited scene, and how it came about."""

    scene: EditedScene
    stretches: tuple[Stretch, ...]
    placements: KeyPlacements
    chosen: tuple[int, ...]  # row of each segment's solution group


def lay_out(scene: SceneFile, people: Mapping[str, Person], fps: float) -> tuple[Stretch, ...]:
    """The scene's time line."""
    a, b = scene.segments[0].between
    keys = [KeyRange(s.frames[a], s.frames[b], s.retime) for s in scene.segments]
    numbers = [np.array(people[name].sequence.numbers) for name in (a, b)]
    rates = fps / people[a].sequence.fps, fps / people[b].sequence.fps
    return time_line(keys, numbers[0], numbers[1], rates=rates)


def assemble(
    scene: SceneFile,
    people: Mapping[str, Person],
    solved: Sequence[SolvedSegment],
    *,
    fps: float,
    rows: Sequence[IntArray] | None = None,
) -> Assembly:
    """Choose the best chain and carry everyone along it.

    Args:
        scene: the scene file.
        people: by name.
        solved: key segments, in order.
        fps: of the scene.
        rows: (N,) of each segment, the solutions to choose from; None for all.

    Raises:
        NoSolution: a segment has no solution, or adjoining ones have none in common.
    """
    stretches = lay_out(scene, people, fps)
    left = [np.arange(segment.n_solutions) for segment in solved] if rows is None else rows
    left = shared_rows(solved, left) or left
    keys = [_key_segment(segment, own) for segment, own in zip(solved, left, strict=True)]
    stages = stages_of(keys, _adjoining(stretches, len(solved)))
    search, optimise = scene.search, scene.optimise
    placements = best_placements(stages, facing_weight=optimise.facing_weight, step=search.step, n_yaw=search.n_yaw)
    names = scene.segments[0].between
    canonical = _by_segment(stages, placements)
    world = people[names[0]].pose  # A's capture frame is the scene's
    subjects = {}
    for name, side, own in zip(names, (0, 1), ("a", "b"), strict=True):
        person = people[name]
        fixed = [compose(compose(world, pose), invert(person.pose)) for pose in canonical[side]]
        gauge = 0.0 if side == 0 else placements.gauge + world[2] - person.pose[2]
        subjects[name] = _subject_edit(person, stretches, own, fixed, gauge, optimise)
    segments, chosen = _segment_edits(solved, stretches, stages, placements, people)
    edited = EditedScene(
        name=scene.name,
        fps=fps,
        n_frames=stretches[-1].stop,
        subjects=subjects,
        segments=segments,
        cost=placements.cost,
        lower_bound=placements.lower_bound,
        gap=placements.gap,
    )
    return Assembly(edited, stretches, placements, chosen)


def shared_rows(solved: Sequence[SolvedSegment], rows: Sequence[IntArray]) -> list[IntArray] | None:
    """The solutions that all segments share. A chain of these costs nothing, so no others need to be looked at.

    Args:
        solved: key segments.
        rows: (N,) of each segment, ascending, the solutions to choose from.

    Returns:
        Rows of each segment, one pose a row; None where the segments share none.
    """
    order = sorted(range(len(solved)), key=lambda index: len(rows[index]))
    keys = solved[order[0]].keys(rows[order[0]])
    for index in order[1:]:
        at = solved[index].rows_at(keys)
        keys = (
            keys[(at >= 0) & np.isin(at, rows[index])]
            if len(rows[index]) < solved[index].n_solutions
            else keys[at >= 0]
        )
    return [segment.rows_at(keys) for segment in solved] if len(keys) else None


def _key_segment(segment: SolvedSegment, rows: IntArray) -> KeySegment:
    group = segment.group if len(rows) == segment.n_solutions else segment.rows(rows)
    return KeySegment(segment.spec.name, group, segment.merit(rows), segment.grid.root_a, segment.grid.root_b)


def _adjoining(stretches: Sequence[Stretch], count: int) -> list[bool]:
    """(I - 1,) whether no frame of the scene lies between a key segment and the next."""
    stop = {s.segment: s.stop for s in stretches if s.segment is not None}
    start = {s.segment: s.start for s in stretches if s.segment is not None}
    return [stop[i] == start[i + 1] for i in range(count - 1)]


def _by_segment(stages: Sequence[Stage], placements: KeyPlacements) -> tuple[list[FloatArray], list[FloatArray]]:
    """World placement of A's and B's canonical frames, one a segment."""
    a = [placements.a[g] for g, stage in enumerate(stages) for _ in stage.names]
    b = [placements.b[g] for g, stage in enumerate(stages) for _ in stage.names]
    return a, b


def _subject_edit(
    person: Person,
    stretches: Sequence[Stretch],
    side: str,
    fixed: Sequence[FloatArray],
    gauge: float,
    settings: OptimiseSettings,
) -> SubjectEdit:
    """One subject's frames and placements; its own motion is told in the gauge, in which it is to be kept."""
    source = np.concatenate([s.pair.a if side == "a" else s.pair.b for s in stretches])
    placements = np.full((len(source), 3), np.nan)
    for stretch in stretches:
        if stretch.segment is not None:
            placements[stretch.start : stretch.stop] = fixed[stretch.segment]
    turn = np.array([0.0, 0.0, gauge])
    kept_motion = compose(placements, invert(turn))
    facing = person.facing.yaw[np.searchsorted(person.facing.numbers, source)] + gauge
    centres = person.centres_at(source) @ rotation(gauge).T
    path = placement_path(kept_motion, centres=centres, facing=facing, settings=_path_settings(settings))
    path = compose(path, turn)
    path[:, 2] = wrap_angle(path[:, 2])
    return SubjectEdit(source, path)


def _path_settings(optimise: OptimiseSettings) -> PathSettings:
    return PathSettings(
        acceleration=optimise.acceleration,
        alpha=optimise.alpha,
        slow_speed=optimise.slow_speed,
        slow_turn=optimise.slow_turn,
    )


def _segment_edits(
    solved: Sequence[SolvedSegment],
    stretches: Sequence[Stretch],
    stages: Sequence[Stage],
    placements: KeyPlacements,
    people: Mapping[str, Person],
) -> tuple[tuple[SegmentEdit, ...], tuple[int, ...]]:
    stage_of = [g for g, stage in enumerate(stages) for _ in stage.names]
    where = {s.segment: s for s in stretches if s.segment is not None}
    edits, rows = [], []
    for index, segment in enumerate(solved):
        g = stage_of[index]
        row = int(segment.rows_at(stages[g].keys[[placements.chosen[g]]])[0])
        chosen = segment.rows(np.array([row]))
        a, b = segment.spec.between
        edits.append(
            SegmentEdit(
                name=segment.spec.name,
                start=where[index].start,
                stop=where[index].stop,
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
