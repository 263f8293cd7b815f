"""Which mesh a subject shows in each frame of the scene: the one door to stopped meshes.

Everybody downstream asks captures for meshes by the numbers of their frames. So stopped meshes are given numbers of
their own, and are put behind the captured frames: what is made of an edit and captures by the functions below is read
like one in which nothing was stopped.
"""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.scene.edit import EditedScene, SubjectEdit
from mhvedit.sequences.meshes import BODY, Mesh, MeshSequence

OWN: Final = 10**9  # number of the mesh that frame 0 of the scene has for itself


def shown_numbers(edit: SubjectEdit) -> IntArray:
    """(N,) number of the mesh in each frame of the scene: the captured frame's, or one of its own."""
    numbers = edit.source.copy()
    if edit.touched is not None:
        own = np.array(edit.touched.frames, np.int64)
        numbers[own] = OWN + own
    return numbers


def shown_scene(scene: EditedScene) -> EditedScene:
    """The edit with the numbers of what it shows, to be read with captures of `shown_capture`."""
    subjects = {name: SubjectEdit(shown_numbers(own), own.placements) for name, own in scene.subjects.items()}
    return replace(scene, subjects=subjects)


def shown_capture(capture: MeshSequence, edit: SubjectEdit, part: str = BODY) -> MeshSequence:
    """A capture with the subject's stopped meshes behind its own frames.

    Args:
        capture: of the subject's body, or of a thing that it holds.
        edit: of the subject.
        part: `body`, or the name of the thing.
    """
    if edit.touched is None:
        return capture
    own = {OWN + frame: int(edit.source[frame]) for frame in edit.touched.frames}
    files = (*capture.files, *(edit.touched.file,) * (len(own) if capture.per_frame else 1)) if capture.files else ()
    return replace(
        capture,
        numbers=(*capture.numbers, *own),
        load=partial(_load, capture=capture, edit=edit, part=part),
        files=files,
        made_of={**capture.made_of, **own},
    )


def _load(number: int, *, capture: MeshSequence, edit: SubjectEdit, part: str) -> Mesh:
    """A captured frame, or a stopped one."""
    touched = edit.touched
    if number < OWN or touched is None:
        return capture.load(number)
    frame = number - OWN
    if part == BODY:
        return touched.meshes.mesh(frame)
    mesh, moves = capture.mesh(int(edit.source[frame])), touched.things.get(part)
    if moves is None:
        return mesh
    return replace(mesh, vertices=moved(moves[touched.frames.index(frame)], mesh.vertices))


def moved(move: FloatArray, points: FloatArray) -> FloatArray:
    """Points (N, 3) m after a rigid movement (3, 4)."""
    return np.asarray(points @ move[:, :3].T + move[:, 3])
