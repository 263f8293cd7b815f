"""What there is to look at: who shows which frame where, and what was found for each key segment."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert, rotation, wrap_angle
from mhvedit.pipeline.assemble import lay_out
from mhvedit.pipeline.job import Job, Result
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.picks import Frames, canonical_frames
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.shown import shown_people
from mhvedit.project.schema import Spot
from mhvedit.scene.edit import EditedScene, PropEdit, SegmentEdit, SubjectEdit
from mhvedit.scene.shown import shown_scene
from mhvedit.search.groups import SolutionGroup
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import OUTSIDE, ReasonMap
from mhvedit.sequences.align import TimeLine
from mhvedit.sequences.meshes import Gaze, MeshSequence
from mhvedit.view.words import FIRST, LAST

UNSOLVED = "not solved yet: people stand where their captures begin, apart from each other"
AT_FIRST = 1.6  # m from A, ahead of her, where B stands before anything is known
ASIDE = 2.0  # m between people who have nothing to do with each other, before anything is known


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """A capture that could be opened, and what is known of the person in it; in the capture's frame."""

    sequence: MeshSequence
    things: tuple[MeshSequence, ...]  # own meshes that are held, as swords
    gaze: Gaze
    numbers: IntArray  # (T,) frame numbers of `centres`
    centres: FloatArray  # (T, 2) m

    def centres_at(self, numbers: IntArray) -> FloatArray:
        """(N, 2) m, where the person is in plan."""
        captured = [self.sequence.origin(number) for number in numbers.tolist()]
        return np.asarray(self.centres[np.searchsorted(self.numbers, captured)])

    def look_at(self, number: int) -> tuple[FloatArray, FloatArray] | None:
        """Eye (3,) m and direction (3,) of the gaze in a frame; None where it is not known."""
        number = self.sequence.origin(number)
        row = int(np.searchsorted(self.gaze.numbers, number))
        if row >= len(self.gaze.numbers) or self.gaze.numbers[row] != number:
            return None
        return self.gaze.eye[row], self.gaze.direction[row]


@dataclass(frozen=True, slots=True, eq=False)
class SetPiece:
    """A prop, and where it is in each frame of the scene."""

    sequence: MeshSequence
    edit: PropEdit


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """What is large of a segment."""

    found: ReasonMap
    group: SolutionGroup
    penalty: FloatArray  # (S,) m of clearance, what the quality of the contact speaks against each solution


@dataclass(frozen=True, eq=False)  # no slots: what is large is fetched when it is first looked at
class SegmentView:
    """A key segment: where it is on the time line, and what was found for it."""

    name: str
    interaction: str
    between: tuple[str, str]  # A, B
    start: int  # first frame in the scene
    stop: int  # past the last
    fetch: Callable[[], Searched]
    n_solutions: int
    grid: PoseGrid
    facing: tuple[float, float]  # rad, of A and B in their canonical frames
    frames: Frames  # canonical frames of A and B
    chosen: int | None  # row of the group
    why: str = ""  # for an empty group: what stands in the way, in words

    @cached_property
    def searched(self) -> Searched:
        """What is large."""
        return self.fetch()

    @property
    def found(self) -> ReasonMap:
        """What accepted or first rejected each pose of the grid."""
        return self.searched.found

    @property
    def group(self) -> SolutionGroup:
        """All solutions."""
        return self.searched.group

    @property
    def moment(self) -> int:
        """The frame of the scene that tells most: where the contact begins or ends, or else the middle."""
        if self.interaction in FIRST:
            return self.start
        return self.stop - 1 if self.interaction in LAST else (self.start + self.stop) // 2

    def captured(self, pose: FloatArray) -> FloatArray:
        """(3,) of B's capture frame in A's, of a pose of the canonical frames."""
        turned = compose(compose(self.frames[0], pose), invert(self.frames[1]))
        turned[2] = wrap_angle(turned[2])
        return turned

    def spot(self, pose: FloatArray) -> Spot:
        """A pose of the canonical frames as the scene file tells it."""
        x, y, yaw = self.captured(pose).tolist()
        return Spot(x, y, yaw)


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """All that a viewer shows of a scene."""

    name: str
    fps: float  # Hz
    n_frames: int
    tracks: Mapping[str, SubjectEdit]  # of all subjects, also of those whose capture is not there
    cast: Mapping[str, Actor]  # whose captures are there
    segments: tuple[SegmentView, ...]
    spans: tuple[SegmentEdit, ...]  # key segments on the time line, also where nothing was searched yet
    placed: bool  # whether the placements are an answer
    notes: tuple[str, ...] = ()  # what is missing or has failed, in sentences
    props: Mapping[str, SetPiece] = field(default_factory=dict)  # of an answer

    def segment(self, name: str) -> SegmentView | None:
        """A segment by name; None where it was not searched."""
        return next((segment for segment in self.segments if segment.name == name), None)


def actor_of(person: Person) -> Actor:
    """What the viewer shows of a person."""
    things = tuple(person.subject.held.values())
    numbers = np.array([number for number in person.sequence.numbers if person.sequence.origin(number) == number])
    return Actor(person.sequence, things, person.gaze, numbers, person.centres)


def material_of(result: Result, notes: tuple[str, ...] = ()) -> Material:
    """What a solve found.

    Args:
        result: of `solve` or `choose`.
        notes: more to tell.
    """
    people, job = result.people, result.job
    chosen = (None,) * len(result.segments) if result.assembly is None else result.assembly.chosen
    starts = _key_starts(job, people)
    views = []
    for solved, row, start in zip(result.segments, chosen, starts, strict=True):
        miss = result.misses.get(solved.spec.name)
        why = "" if miss is None else f"{miss.killed_by} ({miss.poses:,} poses got that far); {miss.nearest}"
        views.append(_view(solved, people, start, row, why))
    edit = None if result.assembly is None else result.assembly.scene
    failure = () if result.failure is None else (f"no answer: {result.failure}",)
    return assembled(job, people, tuple(views), edit, (*notes, *failure))


def unsolved(job: Job, people: Mapping[str, Person], notes: tuple[str, ...] = ()) -> Material:
    """A scene that nobody has solved yet: people opposite each other, on the time line that the scene will have.

    Args:
        job: loaded.
        people: by name.
        notes: more to tell.
    """
    return assembled(job, people, (), None, (*notes, UNSOLVED))


def assembled(
    job: Job,
    people: Mapping[str, Person],
    segments: tuple[SegmentView, ...],
    edit: EditedScene | None,
    notes: tuple[str, ...],
) -> Material:
    """Material of parts; where there is no edit, every segment is shown at its own best or nearest pose.

    Args:
        job: the scene.
        people: by name.
        segments: what was searched.
        edit: None where there is no answer.
        notes: to tell.
    """
    cast = {name: actor_of(person) for name, person in people.items()}
    if edit is not None:
        cast = {name: actor_of(person) for name, person in shown_people(people, edit).items()}
        return Material(
            name=edit.name,
            fps=edit.fps,
            n_frames=edit.n_frames,
            tracks=shown_scene(edit).subjects,
            cast=cast,
            segments=segments,
            spans=edit.segments,
            placed=True,
            notes=notes,
            props={n: SetPiece(job.props[n].sequence, own) for n, own in edit.props.items() if n in job.props},
        )
    line = lay_out(job.scene, people, job.fps)
    shown = {view.name: view.captured(best_guess(view)) for view in segments}
    relatives = [
        shown.get(spec.name, _opposite(*(people[name] for name in spec.between))) for spec in job.scene.segments
    ]
    spans = tuple(
        SegmentEdit(spec.name, span.start, span.stop, spec.interaction.value, spec.between, 0, 0, 0, relative)
        for spec, span, relative in zip(job.scene.segments, line.spans, relatives, strict=True)
    )
    places = _beside_each_other(line, spans)
    tracks = {name: SubjectEdit(source, places[name]) for name, source in line.sources.items()}
    return Material(job.scene.name, job.fps, line.n_frames, tracks, cast, segments, spans, placed=False, notes=notes)


def _beside_each_other(line: TimeLine, spans: Sequence[SegmentEdit]) -> dict[str, FloatArray]:
    """(N, 3) placements by subject: in each segment one stands beside the other, who stays; strangers stand aside."""
    places: dict[str, FloatArray] = {}
    for span in spans:
        a, b = span.between
        if a not in places and b in places:
            start, relative = 0, invert(span.relative)
            a, b = b, a
        else:
            start, relative = span.start if b in places else 0, span.relative
        here = places.setdefault(a, np.tile([0.0, ASIDE * len(places), 0.0], (line.n_frames, 1)))[span.start]
        beside = places.setdefault(b, np.zeros((line.n_frames, 3)))
        beside[start:] = compose(here, relative)
    return places | {
        name: np.tile([0.0, ASIDE * (len(places) + n), 0.0], (line.n_frames, 1))
        for n, name in enumerate(name for name in line.sources if name not in places)
    }


def best_guess(view: SegmentView) -> FloatArray:
    """(3,) canonical: the solution with most room, or where there is none a pose that got furthest."""
    if view.n_solutions:
        return np.asarray(view.group.poses[int(np.argmax(view.group.clearance - view.searched.penalty))])
    reason = view.found.reason
    cells = np.argwhere(reason == max(int(reason.max()), OUTSIDE))
    middle = np.median(cells, axis=0)
    nearest = int(np.argmin(np.abs(cells - middle).sum(1)))
    return np.asarray(view.grid.poses(cells[[nearest]])[0])


def _view(solved: SolvedSegment, people: Mapping[str, Person], start: int, row: int | None, why: str) -> SegmentView:
    return SegmentView(
        name=solved.spec.name,
        interaction=solved.spec.interaction.value,
        between=solved.spec.between,
        start=start,
        stop=start + solved.pair.n_frames,
        fetch=lambda: Searched(solved.found, solved.group, solved.penalty),
        n_solutions=solved.n_solutions,
        grid=solved.grid,
        facing=solved.facing,
        frames=canonical_frames(solved, people),
        chosen=row,
        why=why,
    )


def _key_starts(job: Job, people: Mapping[str, Person]) -> Sequence[int]:
    """The first frame in the scene of each key segment."""
    return [span.start for span in lay_out(job.scene, people, job.fps).spans]


def _opposite(a: Person, b: Person) -> FloatArray:
    """(3,) B's capture frame in A's: ahead of A at her first frame, looking at her."""
    ahead, own = float(a.facing.yaw[0]), float(b.facing.yaw[0])
    yaw = ahead + np.pi - own
    place = a.centres[0] + AT_FIRST * np.array([np.cos(ahead), np.sin(ahead)]) - rotation(yaw) @ b.centres[0]
    return np.array([*place, float(wrap_angle(yaw))])
