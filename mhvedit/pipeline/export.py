"""Takes an edited scene to other programs: opens an output folder and its captures, and writes what is asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.export.content import Exported, ExportScene, Piece, Tell, check_frames
from mhvedit.export.folder import MeshFormat, write_folder
from mhvedit.export.gltf import write_glb
from mhvedit.export.movie import encoder, even_size, frames_shown, write_movie
from mhvedit.export.target import ExportError, Format, check_free, format_of
from mhvedit.export.usd_edit import write_usd_edit
from mhvedit.export.usd_flat import write_flat_usd
from mhvedit.geometry.arrays import ByteArray
from mhvedit.pipeline.folders import EDIT, check_answered
from mhvedit.pipeline.job import Job
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.progress import silent
from mhvedit.pipeline.run import job_of
from mhvedit.pipeline.shown import shown_subjects
from mhvedit.project.schema import OwnMeshSpec, SubjectSpec
from mhvedit.project.subjects import Subject
from mhvedit.scene.edit import EditedScene, read_edit
from mhvedit.scene.eyes import Eyes, eyes_in
from mhvedit.scene.shown import shown_scene
from mhvedit.sequences.meshes import BODY, MeshSequence
from mhvedit.view.film import Cameras, film, fixed_cameras, orbit_cameras, scene_boxes
from mhvedit.view.studio import check_can_draw
from mhvedit.volumes.parts import OwnMesh

FIXED, ORBIT = "fixed", "orbit"
MOVIE_SIZE: Final = (1280, 720)
SMALLEST, LARGEST = 16, 8192  # pixels, of a side of a movie


@dataclass(frozen=True, slots=True)
class ExportSettings:
    """How to export; None and False are the defaults, and what does not concern a format must be left at them."""

    flatten: bool = False  # USD: everything in one file
    assets: Path | None = None  # USD edit layer: folder of the copies of captures; None: beside it
    draco: bool = False  # GLB: compress the meshes
    files: MeshFormat | None = None  # folder: obj or ply; None: obj
    up: str | None = None  # USD, folder: z or y; None: z
    camera: str | None = None  # movie: fixed, orbit, or the name of the subject whose eyes they are; None: fixed
    size: tuple[int, int] | None = None  # movie: width and height in pixels; None: 1280 x 720
    fps: float | None = None  # movie: Hz; None: the scene's


CONCERNS: Final[Mapping[Format, frozenset[str]]] = {
    Format.USD: frozenset({"flatten", "assets", "up"}),
    Format.GLB: frozenset({"draco"}),
    Format.FOLDER: frozenset({"files", "up"}),
    Format.MOVIE: frozenset({"camera", "size", "fps"}),
}
OPTIONS: Final = {"files": "--format"}  # where a setting's option is not called like it


def export_output(
    out: Path, to: Path, settings: ExportSettings, *, force: bool = False, progress: Tell | None = None
) -> Exported:
    """Export the edited scene of an output folder; all that is wrong with the request is said before anything is read.

    Args:
        out: written by `run_scene`.
        to: file or folder; its extension says the format.
        settings: how.
        force: an earlier file or export may be replaced.
        progress: told how far it is.

    Raises:
        ExportError: it cannot be made as it is asked for.
        CaptureError: there is no edit, or a frame of a capture cannot be read.
        MissingLibrary: an extra is not installed.
        NoAnswer: nothing fitted, so there is no edit.
    """
    check_request(to, settings, force=force)
    check_answered(out, to_be="exported")
    edit = read_edit(out / EDIT)
    job = job_of(out)
    scene = export_scene(edit, job, out)
    tell = progress or silent
    match format_of(to):
        case Format.GLB:
            return write_glb(scene, to, draco=settings.draco, tell=tell)
        case Format.FOLDER:
            files = settings.files or MeshFormat.OBJ
            return write_folder(scene, to, files=files, up=settings.up or "z", tell=tell)
        case Format.MOVIE:
            return _write_film((scene, edit), job, to, settings, tell)
        case Format.USD:
            up = settings.up or "z"
            if settings.flatten or to.suffix.lower() == ".usdz":
                return write_flat_usd(scene, to, up=up, tell=tell)
            return write_usd_edit(scene, to, assets=settings.assets or assets_of(to), up=up, tell=tell)


def assets_of(to: Path) -> Path:
    """Where an edit layer has its copies of captures, if nobody says otherwise."""
    return to.with_name(f"{to.stem}_assets")


def check_request(to: Path, settings: ExportSettings, *, force: bool) -> None:
    """Refuse what cannot be made, before anything is read.

    Raises:
        ExportError: unknown extension, an option that does not concern the format, or something is there already.
    """
    kind = format_of(to)
    for setting in fields(ExportSettings):
        if setting.name not in CONCERNS[kind] and getattr(settings, setting.name) != setting.default:
            option = OPTIONS.get(setting.name, f"--{setting.name}")
            raise ExportError(to, f"options that concern {_kind_words(kind)}", option)
    if settings.assets is not None and (settings.flatten or to.suffix.lower() == ".usdz"):
        raise ExportError(to, "--assets with an edit layer, not with a flattened stage", "--assets")
    if settings.up not in (None, "y", "z"):
        raise ExportError(to, "--up y or z", repr(settings.up))
    if settings.size is not None and not all(SMALLEST <= side <= LARGEST for side in settings.size):
        found = "x".join(map(str, settings.size))
        raise ExportError(to, f"a size from {SMALLEST} to {LARGEST} pixels a side", found)
    check_free(to, force=force)


def _kind_words(kind: Format) -> str:
    return {Format.USD: "USD", Format.GLB: "a .glb", Format.FOLDER: "a folder of meshes", Format.MOVIE: "a movie"}[kind]


def export_scene(edit: EditedScene, job: Job, out: Path) -> ExportScene:
    """An edit with the captures that its scene file names.

    Args:
        edit: of the output folder.
        job: of the same.
        out: for error sentences.

    Raises:
        CaptureError: the scene file has not the subjects of the edit.
        MissingFrame: a capture has not a frame of the edit.
    """
    if set(edit.subjects) != set(job.subjects):
        expected = f"the subjects of {job.scene.file} ({', '.join(sorted(job.subjects))})"
        raise CaptureError(out / EDIT, expected, ", ".join(sorted(edit.subjects)))
    if set(edit.props) != set(job.props):
        expected = f"the props of {job.scene.file} ({', '.join(sorted(job.props)) or 'none'})"
        found = f"{', '.join(sorted(edit.props)) or 'none'}: run `mhvedit solve` again"
        raise CaptureError(out / EDIT, expected, found)
    taken, subjects = {*edit.subjects, *edit.props}, shown_subjects(job.subjects, edit)
    pieces = [piece for name in edit.subjects for piece in _pieces(subjects[name], job.scene.subjects[name], taken)]
    for name, prop in job.props.items():
        pieces.append(Piece(name, BODY, name, prop.sequence, prop.spec.path.path, prop.spec.units, prop.spec.up))
    scene = ExportScene(shown_scene(edit), tuple(pieces))
    check_frames(scene)
    return scene


def _pieces(subject: Subject, spec: SubjectSpec, taken: set[str]) -> list[Piece]:
    """The body and all things that have meshes of their own; `taken` learns their names."""
    place = (spec.path.path, spec.units, spec.up)
    if spec.self_collision is not None:
        place = (subject.sequence.files[0], "m", "z")
    found = [Piece(spec.name, BODY, spec.name, subject.sequence, *place)]
    for part, opened in subject.parts.items():
        asked = spec.parts.get(part)
        if isinstance(opened, OwnMesh) and isinstance(asked, OwnMeshSpec):
            name = f"{spec.name}_{part}"
            while name in taken:
                name += "_"
            taken.add(name)
            found.append(Piece(spec.name, part, name, opened.sequence, asked.path.path, spec.units, spec.up))
    return found


def _write_film(
    scenes: tuple[ExportScene, EditedScene], job: Job, to: Path, settings: ExportSettings, tell: Tell
) -> Exported:
    """Draw and encode; the second scene has the numbers of captured frames, for which gaze is known."""
    scene, captured = scenes
    encoder()
    check_can_draw()
    edit = scene.edit
    size = even_size(*(settings.size or MOVIE_SIZE))
    fps = settings.fps or edit.fps
    captures = {piece.subject: piece.sequence for piece in scene.pieces if piece.part == BODY}
    things = {name: [piece.sequence for piece in scene.pieces_of(name) if piece.part != BODY] for name in edit.subjects}
    tell("movie: cameras", 0.0)
    cameras = _cameras((edit, captured), job, to, settings.camera or FIXED, captures, things, aspect=size[0] / size[1])
    shown = frames_shown(edit.n_frames, edit.fps, fps)
    drawn = film(edit, captures, frames=shown, cameras=cameras, size=size, things=things)

    def told() -> Iterator[ByteArray]:
        for done, picture in enumerate(drawn):
            yield picture
            tell("movie: frames", (done + 1) / len(shown))

    done = write_movie(told(), to, size=size, fps=fps)
    asked = settings.size or MOVIE_SIZE
    if asked == size:
        return done
    said = f"{asked[0]}x{asked[1]} is drawn as {size[0]}x{size[1]}: H.264 needs even sides"
    return Exported(done.written, warnings=(said,))


def _cameras(
    edits: tuple[EditedScene, EditedScene],
    job: Job,
    to: Path,
    camera: str,
    captures: Mapping[str, MeshSequence],
    things: Mapping[str, Sequence[MeshSequence]],
    *,
    aspect: float,
) -> Cameras:
    """A camera for each frame of the scene, or somebody's eyes; edits as in `_write_film`."""
    edit, captured = edits
    if camera in edit.subjects:
        return eyes_of(captured, job, camera)
    if camera not in (FIXED, ORBIT):
        raise ExportError(to, f"--camera {FIXED}, {ORBIT}, {' or '.join(edit.subjects)}", repr(camera))
    boxes = scene_boxes(edit, captures, things=things)
    return fixed_cameras(boxes, aspect=aspect) if camera == FIXED else orbit_cameras(boxes, aspect=aspect)


def eyes_of(edit: EditedScene, job: Job, name: str) -> Eyes:
    """Where a subject's eyes are and look in each frame of the scene.

    Raises:
        CaptureError: a gaze that is given, but not for all frames.
    """
    gaze = meet_people(job.scene, job.subjects, job.store)[name].gaze
    eyes = eyes_in(name, edit.subjects[name], gaze)
    missing = np.isnan(eyes.eye[:, 0])
    if missing.any():
        found = f"none in frame {edit.subjects[name].source[missing][0]}"
        raise CaptureError(job.scene.file, f"a gaze of {name} in all frames of the scene", found)
    return eyes
