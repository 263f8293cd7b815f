"""Which scenes a batch is asked for: scene files, folders of them, and templates."""

import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mhvedit.batch.template import is_template, made_scenes, read_template
from mhvedit.errors import SceneError
from mhvedit.project.scene_file import read_text

SCENE = "scene.toml"  # a scene file that the batch writes, in the scene's own output folder


@dataclass(frozen=True, slots=True)
class AskedScene:
    """One scene of a batch."""

    name: str  # of its folder in the output
    file: Path  # the scene file
    content: str | None = None  # what is to stand in it; None: it stands there already
    solutions: int = 1  # how many, each unlike the others


def asked_scenes(arguments: Sequence[Path], out: Path, *, solutions: int = 1) -> tuple[AskedScene, ...]:
    """Find out what is asked for; nothing is written.

    Args:
        arguments: scene files, templates, and folders of both.
        out: output folder of the batch.
        solutions: how many of each scene file that is named itself or stands in a folder.

    Raises:
        SceneError: a template is none, or a folder holds nothing.
    """
    found: list[AskedScene] = []
    files = dict.fromkeys(file.absolute() for argument in arguments for file in _files(argument))
    for file in files:
        if _told_to_be_a_template(file):
            template = read_template(file)
            for name, content in made_scenes(template, out).items():
                found.append(AskedScene(name, out / name / SCENE, content, template.solutions))
        else:
            found.append(AskedScene(file.stem, file, None, solutions))
    return _with_own_names(found)


def _files(argument: Path) -> list[Path]:
    """A file, or the TOML files of a folder."""
    if not argument.is_dir():
        return [argument]
    files = sorted(argument.glob("*.toml"))
    if not files:
        raise SceneError(argument, "folder", "scene files or templates (.toml)", "none")
    return files


def _told_to_be_a_template(file: Path) -> bool:
    """Whether a file is a template; what cannot be read is a scene file, and fails alone as one."""
    try:
        return is_template(tomllib.loads(read_text(file)))
    except (SceneError, ValueError, RecursionError):
        return False


def _with_own_names(found: Sequence[AskedScene]) -> tuple[AskedScene, ...]:
    """Scenes of one name are told apart by the folders that they come from."""
    count = Counter(scene.name for scene in found)
    named = [
        replace(scene, name=f"{scene.file.parent.name}-{scene.name}")
        if count[scene.name] > 1 and scene.content is None
        else scene
        for scene in found
    ]
    for name, times in Counter(scene.name for scene in named).items():
        if times > 1:
            files = " and ".join(str(scene.file) for scene in named if scene.name == name)
            raise SceneError(files, "name", "scenes of different names or folders", f'{times} called "{name}"')
    return tuple(named)
