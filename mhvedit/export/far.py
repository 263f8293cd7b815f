"""Scenes far from the origin, as survey coordinates are: float32 points are kept near it, placements tell the rest."""

from dataclasses import replace

import numpy as np

from mhvedit.export.content import ExportScene, Piece
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.offsets import FAR, middle_in_plan, offset_of, round_offset, without_offset
from mhvedit.geometry.planar import compose
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.scene.edit import EditedScene, PropEdit, SubjectEdit
from mhvedit.sequences.meshes import BODY, Mesh, MeshSequence


def centred(scene: ExportScene) -> ExportScene:
    """The same scene, told otherwise: captures far from the origin without an offset, which their placements have.

    The offset is where the subject's body is in the first frame of its capture, in whole metres in plan; what the
    subject holds has the same. A scene of captures near the origin is handed back as it is.
    """
    offsets = {name: round_offset(place) for name, place in _middles(scene).items()}
    if not any(offset.any() for offset in offsets.values()):
        return scene
    edit = scene.edit
    edit = replace(
        edit,
        subjects={name: _subject_about(subject, offsets[name]) for name, subject in edit.subjects.items()},
        props={name: _prop_about(prop, offsets[name]) for name, prop in edit.props.items()},
    )
    return ExportScene(edit, tuple(_piece_about(piece, offsets[piece.subject]) for piece in scene.pieces))


def shifted(scene: ExportScene, offset: FloatArray) -> ExportScene:
    """The scene elsewhere in the world.

    Args:
        scene: as it is.
        offset: (2,) m, taken off everybody's place.
    """
    return replace(scene, edit=_shifted_edit(scene.edit, offset)) if offset.any() else scene


def stands(scene: ExportScene) -> FloatArray:
    """(M N, 2) m in the world, where everything that is somewhere stands in each frame, to the size of its motion."""
    found = []
    for name, place in _middles(scene).items():
        if name in scene.edit.props:
            found.append(_prop_about(scene.edit.props[name], place).positions[:, :2])
        else:
            found.append(_subject_about(scene.edit.subjects[name], place).placements[:, :2])
    return np.concatenate(found)


def is_far(scene: ExportScene) -> bool:
    """Whether anything stands where float32 is too coarse for coordinates in the world."""
    return bool((np.hypot(*stands(scene).T) > FAR).any())


def scene_offset(scene: ExportScene) -> FloatArray:
    """(2,) whole metres to take off the world's coordinates where they have to be float32; nothing near the origin."""
    return offset_of(stands(scene))


def shift_warning(name: str, offset: FloatArray) -> tuple[str, ...]:
    """What to say of a file in which the scene is shifted.

    Args:
        name: of the file.
        offset: of `scene_offset`.
    """
    if not offset.any():
        return ()
    x, y = offset.astype(int).tolist()
    distance = np.hypot(*offset) / 1000
    return (
        f"{name}: the scene lies {distance:.3g} km from the origin, too far for the float32 of glTF: it is shifted, "
        f"add ({x}, {y}, 0) m, z up, to be back",
    )


def _middles(scene: ExportScene) -> dict[str, FloatArray]:
    """(2,) m of each subject and prop: its middle in the first frame of its capture, in the capture's frame."""
    bodies = {piece.subject: piece.sequence for piece in scene.pieces if piece.part == BODY}
    return {name: middle_in_plan(bodies[name].mesh(bodies[name].numbers[0]).vertices) for name in scene.movers}


def _subject_about(subject: SubjectEdit, offset: FloatArray) -> SubjectEdit:
    """A subject whose capture is without an offset."""
    return replace(subject, placements=compose(subject.placements, np.array([*offset, 0.0])))


def _prop_about(prop: PropEdit, offset: FloatArray) -> PropEdit:
    """A prop whose mesh is without an offset."""
    return replace(prop, positions=prop.positions + rotation_matrices(prop.rotations) @ np.array([*offset, 0.0]))


def _shifted_edit(edit: EditedScene, offset: FloatArray) -> EditedScene:
    return replace(
        edit,
        subjects={
            name: replace(subject, placements=subject.placements - [*offset, 0.0])
            for name, subject in edit.subjects.items()
        },
        props={name: replace(prop, positions=prop.positions - [*offset, 0.0]) for name, prop in edit.props.items()},
    )


def _piece_about(piece: Piece, offset: FloatArray) -> Piece:
    """A piece whose meshes are without an offset."""
    if not offset.any():
        return piece
    x, y = offset.tolist()
    return replace(piece, sequence=_sequence_about(piece.sequence, offset), offset=(x, y))


def _sequence_about(sequence: MeshSequence, offset: FloatArray) -> MeshSequence:
    def load(number: int) -> Mesh:
        mesh = sequence.load(number)
        return replace(mesh, vertices=without_offset(mesh.vertices, offset))

    return replace(sequence, load=load, place=None)
