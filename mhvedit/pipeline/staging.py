"""Where groups of people stand on the stage: pinned, by marks, or clear of everything that stands there already.

People who meet, be it by others, form a group, and the captures say nothing of how groups stand to each other. Each is
placed as a whole, which changes nobody's motion. One with a pinned person follows her; one with marks fits them best.
Any other takes the nearest free place: its footprint, where anybody of it ever is in plan, overlaps neither the others'
footprints nor a prop's, and lies on the floor. The first group stays where it is if that is free; the next ones are
turned and placed from canonical frames, so that it does not matter how their captures lie.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose, compose, invert, rotation, wrap_angle
from mhvedit.optimise.graph import groups
from mhvedit.optimise.stages import NoSolution
from mhvedit.pipeline.bodies import Body, Surroundings, inside
from mhvedit.pipeline.people import Person
from mhvedit.project.schema import Mark, SceneFile
from mhvedit.scene.edit import EditedScene, SubjectEdit

CELL: Final = 0.05  # m, of footprints
TURNS: Final = np.radians([0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180])
ROOM: Final = 6.0  # m of free plane round everything where there is no floor
ARM: Final = 0.5  # m, what a radian of facing counts for where marks do not fit
NEARLY: Final = 1e-6  # m

Path = Mapping[str, FloatArray]  # (N, 3) placements by person


class NoRoom(NoSolution):
    """A group that has no place on the stage."""

    def __init__(self, names: Sequence[str], why: str) -> None:
        super().__init__(names)
        self.args = (f"{' and '.join(names)}: {why}",)


def on_stage(
    scene: SceneFile,
    edit: EditedScene,
    *,
    people: Mapping[str, Person],
    bodies: Mapping[str, Body],
    around: Surroundings,
) -> EditedScene:
    """The scene with every group of people at its place.

    Args:
        scene: the scene file.
        edit: each group in a world of its own.
        people: by name.
        bodies: by name; may be empty where there is one group and nothing to keep clear of.
        around: what stands on the stage, and its floor.

    Raises:
        NoRoom: a group does not fit, or not to its marks.
    """
    placed: dict[str, FloatArray] = {}
    world = np.zeros(3)  # in which free places are looked for
    for names in sorted(acquainted(edit), key=lambda own: not _is_held(scene, own)):
        paths = {name: edit.subjects[name].placements for name in names}
        if scene.stage.pin in names:
            paths = _following(paths, scene.stage.pin)
        elif marks := [mark for mark in scene.stage.marks if mark.subject in names]:
            paths = _moved(paths, _by_marks(marks, edit, people))
        elif placed:
            upright = _moved(paths, invert(_canonical(names[0], paths, people)))
            there = _moved(placed, invert(world))
            pose = _free_place(names, upright, there, bodies, around)
            paths = _moved(upright, compose(world, pose))
        elif not around.empty:
            paths = _moved(paths, _free_place(names, paths, {}, bodies, around))
        else:
            world = _canonical(names[0], paths, people)
        placed |= paths
    subjects = {name: SubjectEdit(own.source, placed[name]) for name, own in edit.subjects.items()}
    return replace(edit, subjects=subjects)


def acquainted(edit: EditedScene) -> list[tuple[str, ...]]:
    """Groups of people who meet, be it by others."""
    names = list(edit.subjects)
    links = ((names.index(s.between[0]), names.index(s.between[1])) for s in edit.segments)
    return [tuple(names[i] for i in group) for group in groups(len(names), links)]


def _canonical(name: str, paths: Path, people: Mapping[str, Person]) -> FloatArray:
    """(3,) the canonical frame of somebody as she stands in the first frame."""
    return compose(paths[name][0], people[name].pose)


def _is_held(scene: SceneFile, names: Sequence[str]) -> bool:
    return scene.stage.pin in names or any(mark.subject in names for mark in scene.stage.marks)


def _moved(paths: Path, pose: FloatArray) -> dict[str, FloatArray]:
    """Paths as a whole, or frame by frame where there is a pose for each."""
    found = {name: compose(pose, path) for name, path in paths.items()}
    for path in found.values():
        path[:, 2] = wrap_angle(path[:, 2])
    return found


def _following(paths: Path, pin: str) -> dict[str, FloatArray]:
    """Everybody as they stand to somebody who stands as captured."""
    found = _moved(paths, invert(paths[pin]))
    found[pin] = np.zeros_like(paths[pin])
    return found


def _by_marks(marks: Sequence[Mark], edit: EditedScene, people: Mapping[str, Person]) -> FloatArray:
    """The placement of a group that fits its marks best.

    Raises:
        NoRoom: somebody is too far from a mark then.
    """
    stands = np.empty((len(marks), 3))  # where people are and which way they face in the group's world
    for row, mark in zip(stands, marks, strict=True):
        own, person = edit.subjects[mark.subject], people[mark.subject]
        frame = int(np.abs(own.source - mark.frame).argmin())
        number = own.source[[frame]]
        row[:2] = apply_pose(own.placements[frame], person.centres_at(number)[0])
        row[2] = own.placements[frame, 2] + person.facing_over(number)
    points, aims = (at[:, 0] + 1j * at[:, 1] for at in (stands, np.array([mark.at for mark in marks])))
    pull = np.vdot(points - points.mean(), aims - aims.mean())
    for mark, (_, _, yaw) in zip(marks, stands, strict=True):
        if mark.facing is not None:
            pull += ARM**2 * np.exp(1j * (mark.facing - yaw))
    turn = float(np.angle(pull)) if abs(pull) > NEARLY**2 else 0.0
    shift = aims.mean() - np.exp(1j * turn) * points.mean()
    missed = np.abs(np.exp(1j * turn) * points + shift - aims)
    for mark, miss in zip(marks, missed, strict=True):
        if miss > mark.within + NEARLY:
            raise NoRoom([mark.subject], f"{mark.key} is missed by {miss:.2f} m, {mark.within:g} m are allowed")
    return np.array([shift.real, shift.imag, turn])


def _free_place(
    names: Sequence[str], paths: Path, placed: Path, bodies: Mapping[str, Body], around: Surroundings
) -> FloatArray:
    """The nearest free placement of a group: as it is, or beside those who stand already, or on the floor's middle."""
    own = np.concatenate([_plan(bodies[name], paths[name]) for name in names])
    things = [_plan(thing, np.zeros((len(thing.rows), 3))) for thing in around.obstacles.values()]
    taken = [np.zeros((0, 2)), *things, *(_plan(bodies[name], path) for name, path in placed.items())]
    others = np.concatenate(taken)
    middle = own.mean(0)
    aim = np.concatenate(taken[1 + len(things) :]).mean(0) if placed else middle
    if len(around.floor) and not placed and not inside(aim[None], around.floor)[0]:
        aim = around.floor.mean(0)
    best: tuple[float, FloatArray] | None = None
    for turn in TURNS:
        turned = (own - middle) @ rotation(turn).T
        shift = _nearest_free(turned, others, aim, around.floor)
        if shift is None:
            continue
        away = float(np.linalg.norm(shift - aim))
        if best is None or away < best[0] - CELL:
            best = away, np.array([*(shift - rotation(turn) @ middle), turn])
        if away < CELL:
            break
    if best is None:
        raise NoRoom(names, "there is no room for them on the stage, clear of props and of everybody else")
    return best[1]


def _plan(body: Body, placements: FloatArray) -> FloatArray:
    """(K, 2) m, the cells in plan where somebody ever is."""
    cells = {
        cell
        for row, pose in {(row, tuple(pose)) for row, pose in zip(body.rows.tolist(), placements.tolist(), strict=True)}
        for cell in map(
            tuple, np.unique(_cells(apply_pose(np.array(pose), body.shells.of(row))[:, :2]), axis=0).tolist()
        )
    }
    return np.array(sorted(cells)) * CELL


def _cells(points: FloatArray) -> FloatArray:
    return np.asarray(np.round(points / CELL))


def _nearest_free(own: FloatArray, others: FloatArray, aim: FloatArray, floor: FloatArray) -> FloatArray | None:
    """The place (2,) nearest to an aim where points (K, 2) about it keep clear of others (M, 2) and on the floor."""
    reach = float(np.abs(own).max()) + 2 * CELL
    every = np.concatenate([others, floor, aim[None]])
    room = reach if len(floor) else ROOM + 2 * reach
    low, high = every.min(0) - room, every.max(0) + room
    shape = np.ceil((high - low) / CELL).astype(np.int64) + 1
    blocked: BoolArray = np.zeros(shape, np.bool_)
    blocked[tuple(_cells(others - low).astype(np.int64).T)] = True
    from scipy.ndimage import binary_dilation  # takes long to import, and most scenes have an empty stage

    blocked = binary_dilation(blocked, np.ones((3, 3)))
    if len(floor):
        grid = np.stack(np.meshgrid(*(low[i] + CELL * np.arange(shape[i]) for i in (0, 1)), indexing="ij"), -1)
        blocked |= ~inside(grid.reshape(-1, 2), floor).reshape(blocked.shape)
    half = int(np.ceil(reach / CELL))
    stamp = np.zeros((2 * half + 1, 2 * half + 1))
    stamp[tuple((_cells(own).astype(np.int64) + half).T)] = 1.0
    free = np.argwhere(_overlaps(blocked, stamp) < 0.5)
    if not len(free):
        return None
    places = low + (free + half) * CELL
    return np.asarray(places[np.linalg.norm(places - aim, axis=1).argmin()])


def _overlaps(blocked: BoolArray, stamp: FloatArray) -> FloatArray:
    """How many blocked cells a stamp lies on, at every place where it fits: correlation by FFT."""
    spectrum = np.fft.rfft2(blocked) * np.conj(np.fft.rfft2(stamp, blocked.shape))
    counts = np.fft.irfft2(spectrum, blocked.shape)
    return np.asarray(counts[: len(blocked) - len(stamp) + 1, : blocked.shape[1] - stamp.shape[1] + 1])
