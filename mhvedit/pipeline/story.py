"""What the report is told: the result in plain data, subject by subject and segment by segment."""

from collections.abc import Mapping

import numpy as np

from mhvedit.errors import counted
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.keys import segment_parts
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.shown import shown_people
from mhvedit.pipeline.stops_pass import stop_in_words
from mhvedit.project.schema import SegmentSpec
from mhvedit.scene.eyes import eyes_in
from mhvedit.scene.report import SceneReport
from mhvedit.scene.shown import shown_scene
from mhvedit.view.charts import SceneCheck
from mhvedit.view.content import CaptureStory, ReportContent, SegmentStory, StorySide
from mhvedit.volumes.subject import SubjectVolumes, part_of

DOUBTFUL_FACING = 0.3  # trust below which an estimated facing is pointed out


def report_content(
    result: Result, check: SceneReport | None, *, problems: tuple[str, ...], warnings: tuple[str, ...], limit_mm: float
) -> ReportContent:
    """Everything that the report shows.

    Args:
        result: of a solve.
        check: of its scene, if there is one.
        problems: thresholds that are passed, in sentences.
        warnings: about the captures, in sentences.
        limit_mm: how deep bodies may sink into each other.
    """
    scene = None if result.assembly is None else result.assembly.scene
    stories = [_story(result, index) for index in range(len(result.segments))]
    centres, eyes, people = {}, {}, dict(result.people)
    if scene is not None:
        centres = {name: people[name].centres_at(edit.source) for name, edit in scene.subjects.items()}
        eyes = {name: eyes_in(name, edit, people[name].gaze) for name, edit in scene.subjects.items()}
        people, scene = shown_people(people, scene), shown_scene(scene)
    return ReportContent(
        name=result.job.scene.name,
        stories=stories,
        scene=scene,
        captures={name: person.sequence for name, person in people.items()}
        | {name: prop.sequence for name, prop in result.job.props.items()},
        things={name: list(person.subject.held.values()) for name, person in people.items()},
        eyes=eyes,
        check=None if check is None else scene_check(check),
        limit_mm=limit_mm,
        centres=centres,
        passed=scene is not None and not problems,
        about=[_about(result, name, person) for name, person in result.people.items()],
        warnings=[*warnings, *problems, *_dropped(result)],
        notes=_bends(result) + _stops(result),
        settings=_settings(result),
        stage_seconds=result.seconds,
    )


def scene_check(report: SceneReport) -> SceneCheck:
    """The check as the charts take it: of all pairs the one that is nearest or deepest in each frame."""
    least = np.min([pair.gap for pair in report.pairs], axis=0)
    gap = np.where(np.isfinite(least), least, np.nan)
    contact = np.zeros(report.n_frames, np.bool_)
    for segment in report.segments:
        contact[list(segment.contact_frames)] = True
    return SceneCheck(
        penetration_mm=np.where(np.isnan(gap), 0.0, np.maximum(-gap, 0.0)) * 1000,
        gap_mm=np.maximum(gap, 0.0) * 1000,
        contact=contact,
        added_skate={m.subject: _per_frame(m.skate) * report.fps for m in report.motions},
    )


def _per_frame(steps: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.nan_to_num(steps)])


def _story(result: Result, index: int) -> SegmentStory:
    segment, assembly = result.segments[index], result.assembly
    spec = segment.spec
    volumes = segment.volumes()
    sides = [
        _side(segment, name, volume, facing)
        for name, volume, facing in zip(spec.between, volumes, segment.facing, strict=True)
    ]
    chosen = None if assembly is None else assembly.chosen[index]
    miss = result.misses.get(spec.name)
    return SegmentStory(
        name=spec.name,
        interaction=spec.interaction.value,
        a=sides[0],
        b=sides[1],
        n_frames=segment.pair.n_frames,
        found=segment.found,
        group=segment.group,
        chosen=chosen,
        asked=_asked(spec),
        half_angle=None if spec.visibility is None else spec.visibility.half_angle,
        killed_by="" if miss is None else miss.killed_by,
        nearest="" if miss is None else miss.nearest,
        figures={} if chosen is None else _figures(segment, chosen),
        notes=_notes(result, chosen),
    )


def _side(segment: SolvedSegment, name: str, volumes: SubjectVolumes, facing: float) -> StorySide:
    part = segment_parts(segment.spec)[segment.spec.between.index(name)]
    return StorySide(
        subject=name,
        part=part,
        frames=(segment.spec.frames[name].start, segment.spec.frames[name].stop - 1),
        facing=facing,
        part_volume=part_of(volumes, part),
        body_volume=volumes.body,
    )


def _asked(spec: SegmentSpec) -> list[str]:
    tolerance = spec.tolerance
    words = [
        f"contact may miss by {counted(tolerance.frames, 'frame')} and {tolerance.voxels:g} voxels",
        f"parts may sink {tolerance.depth * 1000:.0f} mm, bodies may overlap {tolerance.apart * 1000:.0f} mm",
    ]
    if spec.visibility is not None:
        words.append(f"each in the other's cone of {np.degrees(spec.visibility.half_angle):g} degrees half angle")
    return words


def _figures(segment: SolvedSegment, row: int) -> dict[str, str]:
    return {"Quality penalty": f"{segment.penalty[row] * 1000:.0f} mm of clearance"}


def _notes(result: Result, chosen: int | None) -> list[str]:
    if chosen is None or result.assembly is None:
        return []
    equals = result.assembly.placements.equals
    return [f"{equals:,} chains cost the same; clearance and contact quality decided."] if equals > 1 else []


def _about(result: Result, name: str, person: Person) -> CaptureStory:
    numbers = person.sequence.numbers
    trust = float(np.median(person.facing.trust))
    steps = np.degrees(np.abs(wrap_angle(np.diff(person.facing.yaw))))
    notes = []
    if "facing" in person.estimated and trust < DOUBTFUL_FACING:
        notes.append("The facing is a doubtful estimate: look at it, and give `facing` in the scene file if wrong.")
    if len(steps) and steps.max() > 60:
        notes.append(f"The facing jumps by {steps.max():.0f} degrees at frame {numbers[int(steps.argmax()) + 1]}.")
    repair = None
    if result.job.scene.subjects[name].self_collision is not None:
        from mhvedit.pipeline.repair import repaired_in_words, repaired_story  # takes long to load, and few need it

        repair = repaired_story(person.sequence)
        notes.append(repaired_in_words(person.sequence))
    return CaptureStory(
        name=name,
        facts={
            "frames": f"{len(numbers)}, numbers {numbers[0]} to {numbers[-1]}",
            "rate": f"{person.sequence.fps:g} frames a second",
        },
        facing="estimated from the meshes" if "facing" in person.estimated else "as given in the scene file",
        facing_trust=trust if "facing" in person.estimated else None,
        gaze="estimated from the meshes" if "gaze" in person.estimated else "as given in the scene file",
        notes=notes,
        fitted=repair,
    )


def _dropped(result: Result) -> list[str]:
    """Captured frames that are not shown, and frames of the scene for which there are none."""
    if result.assembly is None:
        return []
    line = result.assembly.line
    return [
        f"At frame {own.frame} of the scene there is no time for "
        f"{counted(own.count, 'frame')} of {own.subject}: left out."
        for own in line.left_out
    ] + [
        f"In frames {own.frame} to {own.frame + own.count - 1} of the scene {own.subject} stands still, "
        "for want of captured frames."
        for own in line.held
    ]


def _bends(result: Result) -> list[str]:
    """Where paths give way."""
    return [
        f"Frames {bend.first} to {bend.last}, between key segments: {' and '.join(bend.between)} would be "
        f"{bend.before_mm:.0f} mm deep in each other, {bend.allowed_mm:.0f} mm are allowed. Their paths give way by up "
        f"to {bend.moved_mm:.0f} mm, at a cost of {bend.cost:.2g} m²; they are {bend.after_mm:.0f} mm deep."
        for bend in (() if result.assembly is None else result.assembly.bends)
    ]


def _stops(result: Result) -> list[str]:
    """Where limbs stop at props."""
    return [f"{stop_in_words(stop)}." for stop in (() if result.assembly is None else result.assembly.stops)]


def _settings(result: Result) -> Mapping[str, str]:
    search, optimise = result.job.scene.search, result.job.scene.optimise
    own = [f"; {spec.name}: {spec.window:g} m" for spec in result.job.scene.segments if spec.window is not None]
    return {
        "voxel": f"{search.voxel * 1000:g} mm",
        "step": f"{search.step * 1000:g} mm, {np.degrees(search.yaw_step):g} degrees",
        "window": f"{search.window:g} m{''.join(own)}",
        "facing weight": f"{optimise.facing_weight:g} m²",
        "path": f"acceleration {optimise.acceleration:g}, alpha {optimise.alpha:g}",
    }
