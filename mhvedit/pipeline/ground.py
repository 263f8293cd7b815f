"""The stage in the search: where one of a pair is pinned, the other's place on the stage is known for every pose.

Then poses at which the other stands off the floor or in a prop are rejected like any others, voxel by voxel, and the
map of the segment says so.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.geometry.planar import apply_pose, compose, invert
from mhvedit.pipeline.bodies import inside
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Key
from mhvedit.project.props import open_props
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.history import MotionHistoryVolume, frame_mask
from mhvedit.volumes.subject import SubjectVolumes, all_of
from mhvedit.volumes.voxelise import solid_voxels

STAGE: Final = "stage"
PROP: Final = "prop"  # and its name


def ground_key(scene: SceneFile, spec: SegmentSpec, known: Contents) -> Key | None:
    """What the stage asks of a segment; None for nothing."""
    if scene.stage.pin not in spec.between:
        return None
    props = [
        (name, prop.units, prop.up, prop.place, known.of(own.sequence.files))
        for name, own in open_props(scene, cache=None).items()
        if (prop := own.spec).kind == "fixed"
    ]
    return (scene.stage.pin, scene.stage.floor, props) if props or scene.stage.floor else None


def ground_clauses(
    scene: SceneFile, spec: SegmentSpec, people: Mapping[str, Person], a: SubjectVolumes, b: SubjectVolumes
) -> tuple[Clause, ...]:
    """Clear of each fixed prop, and on the floor.

    Args:
        scene: the scene file.
        spec: the segment; without a pinned person in it nothing is asked here.
        people: by name.
        a: volumes of its first subject.
        b: and of its second.
    """
    if scene.stage.pin not in spec.between:
        return ()
    pinned = spec.between.index(scene.stage.pin)
    other = all_of((b, a)[pinned]).whole
    canonical = invert(people[spec.between[pinned]].pose)  # of the stage in the pinned person's canonical frame

    def clause(reason: str, thing: MotionHistoryVolume, body: MotionHistoryVolume) -> Clause:
        meeting = Meeting(thing, body) if pinned == 0 else Meeting(body, thing)
        return Clause(reason, (Option(never=(meeting,)),))

    found = []
    for name, prop in open_props(scene, cache=None).items():
        if prop.spec.kind == "fixed":
            placed = Mesh(apply_pose(compose(canonical, prop.place), prop.mesh.vertices), prop.mesh.faces)
            solid = _always(*solid_voxels(placed, other.grid.pitch), other.n_frames)
            if solid.frames.any():
                found.append(clause(f"{PROP} {name}", solid, other))
    if scene.stage.floor:
        body = (a, b)[pinned].body
        floor = np.array(scene.stage.floor)
        off = _off_floor(floor, invert(canonical), body.centre[:2], other, scene.window_of(spec))
        found.append(clause(STAGE, off, _flat(other)))  # even where all is floor: maps of all windows have one key
    return tuple(found)


def _always(grid: VoxelGrid, filled: BoolArray, n_frames: int) -> MotionHistoryVolume:
    """Voxels that are filled in every frame."""
    return MotionHistoryVolume(grid, filled[..., None] * frame_mask(n_frames, range(n_frames)), n_frames)


def _flat(volume: MotionHistoryVolume) -> MotionHistoryVolume:
    """A volume in plan: all its layers as one."""
    (x, y, _), (nx, ny, _) = volume.grid.start, volume.grid.shape
    grid = replace(volume.grid, start=(x, y, 0), shape=(nx, ny, 1))
    return MotionHistoryVolume(grid, np.bitwise_or.reduce(volume.frames, axis=2)[:, :, None], volume.n_frames)


def _off_floor(
    floor: FloatArray, world: FloatArray, root: FloatArray, other: MotionHistoryVolume, window: float
) -> MotionHistoryVolume:
    """One layer of voxels round the pinned root that are not over the floor, as far as the other can be in a window.

    Args:
        floor: (C, 2) m, corners on the stage.
        world: (3,) stage_from_canonical of the pinned person.
        root: (2,) m, of the pinned person.
        other: the other's volume.
        window: side of the search window, m.
    """
    pitch = other.grid.pitch
    corners = np.array([other.grid.start[:2], other.grid.stop[:2]]) * pitch
    reach = float(np.linalg.norm(np.abs(corners - other.centre[:2]).max(0)))
    low = np.floor((root - window / 2 - reach) / pitch).astype(int)
    high = np.ceil((root + window / 2 + reach) / pitch).astype(int)
    nx, ny = (int(n) for n in high - low + 1)
    grid = VoxelGrid((int(low[0]), int(low[1]), 0), (nx, ny, 1), pitch)
    plan = np.stack(np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij"), -1).reshape(-1, 2)
    off = np.concatenate([~inside(apply_pose(world, part), floor) for part in np.array_split(plan, len(grid.axis(0)))])
    return _always(grid, off.reshape(grid.shape), other.n_frames)
