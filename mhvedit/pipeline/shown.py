"""Subjects as an edit shows them: their captures with the meshes that props have stopped."""

from collections.abc import Mapping
from dataclasses import replace

from mhvedit.pipeline.people import Person
from mhvedit.project.subjects import Subject
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.shown import shown_capture
from mhvedit.volumes.parts import OwnMesh, Part


def shown_subjects(subjects: Mapping[str, Subject], scene: EditedScene) -> dict[str, Subject]:
    """Subjects whose captures have all meshes that `scene.shown.shown_scene` names.

    Args:
        subjects: by name; those that are not in the scene stay as they are.
        scene: the edit.
    """
    return {name: _shown(subject, scene) for name, subject in subjects.items()}


def shown_people(people: Mapping[str, Person], scene: EditedScene) -> dict[str, Person]:
    """People likewise; what is known of their captured frames stays."""
    return {name: replace(person, subject=_shown(person.subject, scene)) for name, person in people.items()}


def _shown(subject: Subject, scene: EditedScene) -> Subject:
    edit = scene.subjects.get(subject.name)
    if edit is None or edit.touched is None:
        return subject

    def part(name: str, own: Part) -> Part:
        return replace(own, sequence=shown_capture(own.sequence, edit, name)) if isinstance(own, OwnMesh) else own

    parts = {name: part(name, own) for name, own in subject.parts.items()}
    return replace(subject, sequence=shown_capture(subject.sequence, edit), parts=parts)
