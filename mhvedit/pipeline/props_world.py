"""Simulated props of an edited scene: people and recorded props push them, fixed ones and the floor carry them."""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import groupby
from typing import Final

import numpy as np

from mhvedit.errors import SceneError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.geometry.quaternions import quaternions_of, rotation_matrices
from mhvedit.pipeline.bodies import inside
from mhvedit.pipeline.props_pass import Track, as_arrays, shown_frames
from mhvedit.pipeline.store import Arrays, Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile
from mhvedit.project.subjects import Subject
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.world.among import Among, Crowd, Overlap
from mhvedit.world.balls import as_ball
from mhvedit.world.bodies import Body, BodyClass, Pose, body_of_mesh, body_of_pieces
from mhvedit.world.convex import check_solid
from mhvedit.world.depth import TOLERANCE
from mhvedit.world.flesh import NO_FLESH, Flesh, flesh_near
from mhvedit.world.materials import Materials, load_materials
from mhvedit.world.pieces import box
from mhvedit.world.problems import WorldError
from mhvedit.world.world import World

FLOOR: Final = "the floor"  # no prop can be called so
FLOOR_SIZE: Final = (100.0, 1.0)  # m, half its side, and how thick it is
FLOOR_MATERIAL: Final = "wood"
PERSON_MATERIAL: Final = "human"  # and of what people hold
Placed = Callable[[int], Mesh]  # the mesh of somebody in a frame of the scene, in the world


def require_simulable(scene: SceneFile, props: Mapping[str, Prop]) -> None:
    """Refuse props that cannot be simulated or met, before anything is.

    Raises:
        SceneError: an open mesh, one without volume, or a simulated prop that begins beside the floor.
    """
    floor = np.array(scene.stage.floor)
    for prop in props.values():
        spec = prop.spec
        if spec.kind == "driven" and prop.motion is None:
            continue
        try:
            check_solid(spec.name, prop.mesh.vertices, prop.mesh.faces)
        except WorldError as fault:
            expected = f"{fault.expected}, as props are simulated"
            raise SceneError(scene.file, f"{spec.key}.path", expected, str(fault.found)) from fault
        if spec.kind == "simulated" and len(floor):
            plan = apply_pose(prop.place, prop.mesh.vertices)[:, :2]
            middle = (plan.min(0) + plan.max(0)) / 2
            if not inside(middle[None], floor).all():
                found = f"[{middle[0]:.2f}, {middle[1]:.2f}]"
                raise SceneError(scene.file, f"{spec.key}.place", "a place on the floor", found)


def simulated(
    scene: EditedScene,
    tracks: Mapping[str, Track],
    subjects: Mapping[str, Subject],
    props: Mapping[str, Prop],
    store: Store,
) -> Arrays:
    """Where simulated props are in each frame, and what has to be said about them.

    Args:
        scene: the edit.
        tracks: of all props, as if nothing pushed them.
        subjects: by name.
        props: by name.
        store: where convex pieces are kept.

    Raises:
        CaptureError: a frame cannot be read.
    """
    world = _world(props, store)
    among = Among(world, {FLOOR: Pose(np.eye(3), np.zeros(3)), **_told(world, tracks, 0)})
    crowd, time = _Crowds(scene, subjects, props), 1.0 / scene.fps
    steps = [among.begin(partial(crowd.at, 0))]
    for frame in range(1, scene.n_frames):
        told = {name: pose for name, pose in _told(world, tracks, frame).items() if props[name].spec.kind == "driven"}
        steps.append(among.step(told, partial(crowd.at, frame), time))
    found = {}
    for name in (name for name, prop in props.items() if prop.spec.kind == "simulated"):
        turns = quaternions_of(np.array([step.poses[name].rotation for step in steps]))
        found[name] = np.array([step.poses[name].position for step in steps]), turns
    return as_arrays(found, said_of([step.overlaps for step in steps], props))


def said_of(overlaps: list[tuple[Overlap, ...]], props: Mapping[str, Prop]) -> list[str]:
    """Sentences on what began inside something, and on what could not be freed.

    Args:
        overlaps: of each frame.
        props: by name.
    """
    said = []
    for each in overlaps[0]:
        key, deep, far = props[each.body].spec.key, 1000 * each.depth, 1000 * each.moved
        said.append(f"{key}: begins {deep:.0f} mm inside {each.other}; moved out of it, by {far:.0f} mm")
    left = [(each, frame) for frame, own in enumerate(overlaps) for each in own if each.left > TOLERANCE]
    for body in dict.fromkeys(each.body for each, _ in left):
        own = [(each, frame) for each, frame in left if each.body == body]
        for _, run in groupby(enumerate(own), lambda item: item[1][1] - item[0]):
            stretch = [item for _, item in run]
            worst = max((each for each, _ in stretch), key=lambda each: each.left)
            where = _frames(stretch[0][1], stretch[-1][1])
            said.append(f"{props[body].spec.key}: is held {1000 * worst.left:.0f} mm inside {worst.other} in {where}")
    return said


def _frames(first: int, last: int) -> str:
    return f"frame {first}" if first == last else f"frames {first} to {last}"


class _Crowds:
    """People, what they hold, and props that change their shape: all that pushes and is cut anew in each frame."""

    def __init__(self, scene: EditedScene, subjects: Mapping[str, Subject], props: Mapping[str, Prop]) -> None:
        self._placed, self._materials, self._last = dict[str, Placed](), dict[str, str](), dict[str, Flesh]()
        for name, edit in scene.subjects.items():
            held = {f"{name}'s {part}": thing for part, thing in subjects[name].held.items()}
            for whose, sequence in {name: subjects[name].sequence, **held}.items():
                self._placed[whose] = partial(_placed, sequence, edit.source.tolist(), edit.placements)
                self._materials[whose] = PERSON_MATERIAL
        for name, prop in props.items():
            if prop.spec.kind == "driven" and prop.motion is None:
                places = np.tile(prop.place, (scene.n_frames, 1))
                self._placed[name] = partial(_placed, prop.sequence, shown_frames(prop, scene).tolist(), places)
                self._materials[name] = prop.spec.material
        self._before: dict[str, Mesh] = {}

    def at(self, frame: int, boxes: FloatArray) -> Crowd:
        """All that comes into boxes in a frame; frames are asked for in order."""
        meshes = {name: placed(frame) for name, placed in self._placed.items()}
        for name, mesh in meshes.items():
            last = self._last.get(name, NO_FLESH)
            self._last[name] = flesh_near(mesh, boxes, before=self._before.get(name), last=last)
        self._before = meshes
        return Crowd(tuple(meshes), tuple(self._last[name] for name in meshes), tuple(self._materials.values()))


def _placed(sequence: MeshSequence, numbers: list[int], placements: FloatArray, frame: int) -> Mesh:
    mesh = sequence.mesh(numbers[frame])
    return Mesh(apply_pose(placements[frame], mesh.vertices), mesh.faces)


def _world(props: Mapping[str, Prop], store: Store) -> World:
    """The floor, and all props that keep their shape."""
    materials = load_materials()
    side, thick = FLOOR_SIZE
    ground = box(np.array([-side, -side, -thick]), np.array([side, side, 0.0]))
    bodies = [body_of_pieces(FLOOR, [ground], materials, kind=BodyClass.FIXED, material=FLOOR_MATERIAL)]
    rigid = [prop for prop in props.values() if prop.spec.kind != "driven" or prop.motion is not None]
    return World((*bodies, *(prop_body(prop, materials, store) for prop in rigid)), materials)


def prop_body(prop: Prop, materials: Materials, store: Store) -> Body:
    """A prop that keeps its shape, in convex pieces. Raises WorldError where its mesh is no solid."""
    spec, mesh = prop.spec, prop.mesh
    kind, ball = BodyClass(spec.kind), as_ball(mesh.vertices, mesh.faces)
    if ball is not None:
        return body_of_pieces(spec.name, [ball], materials, kind=kind, material=spec.material, mass=spec.mass)
    cache = None if store.folder is None else store.folder / "convex"
    return body_of_mesh(
        spec.name, mesh.vertices, mesh.faces, materials,
        kind=kind, material=spec.material, mass=spec.mass, cache=cache,
    )  # fmt: skip


def _told(world: World, tracks: Mapping[str, Track], frame: int) -> dict[str, Pose]:
    """Poses of all props of the world in a frame, as if nothing pushed them."""
    names = [body.name for body in world.bodies if body.name != FLOOR]
    return {name: Pose(rotation_matrices(tracks[name][1][frame]), tracks[name][0][frame]) for name in names}
