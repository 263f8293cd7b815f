"""What there is to do about the scenes of a batch, and what is finished of them."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from mhvedit.batch.asked import SCENE, AskedScene
from mhvedit.batch.records import Inputs, recorded
from mhvedit.batch.tasks import BAD, DONE, SceneDone, scene_done, variants_name
from mhvedit.errors import MhveditError
from mhvedit.files import replacing
from mhvedit.pipeline.standing import holds, standing_in
from mhvedit.pipeline.store import hashed
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import SceneFile

Told = Callable[[SceneDone, int, int], None]  # a scene, how many are finished, how many are known of
NOBODY: Final[Told] = lambda done, finished, known: None  # noqa: E731


@dataclass(frozen=True, slots=True)
class Step:
    """A scene that is to be finished, or, where it is finished, to be varied."""

    asked: AskedScene
    scene: SceneFile
    key: str  # of all that the finished scene depends on
    kept: bool = False  # whether its segments are solved already
    done: SceneDone | None = None  # finished, to be varied


@dataclass(frozen=True, slots=True, eq=False)
class Desk:
    """What is known of a batch while it runs."""

    out: Path  # absolute
    waiting: Iterator[AskedScene]  # scenes that nobody has looked into yet
    inputs: Inputs
    check: bool
    report: bool
    told: Told
    known: list[str]  # names of scenes, in order
    steps: deque[Step] = field(default_factory=deque)  # for workers
    done: dict[str, SceneDone] = field(default_factory=dict)

    @property
    def found(self) -> tuple[SceneDone, ...]:
        """What came of the scenes that are finished, in order."""
        return tuple(self.done[name] for name in self.known if name in self.done)


def next_step(desk: Desk) -> Step | None:
    """Something for a worker to do; None where nothing is left.

    Scenes are looked into one by one: those that stand, or are bad, are finished without a worker.
    """
    while not desk.steps:
        asked = next(desk.waiting, None)
        if asked is None:
            return None
        _look_into(desk, asked, kept=False)
    return desk.steps.popleft()


def is_finished(desk: Desk, step: Step, done: SceneDone) -> None:
    """A scene is finished; what may follow are further solutions of it."""
    _tell(desk, done)
    if step.asked.solutions > 1 and done.verdict == DONE:
        made = recorded(desk.out, variants_name(done.name), variants_key(step))
        if made is None:
            desk.steps.appendleft(Step(step.asked, step.scene, step.key, done=done))
        else:
            is_varied(desk, step, made)


def is_varied(desk: Desk, step: Step, made: Mapping[str, str]) -> None:
    """There are further solutions of a scene, each a scene of its own.

    Args:
        desk: of the batch.
        step: the scene.
        made: scene files by name.
    """
    place = desk.known.index(step.asked.name) + 1
    desk.known[place:place] = made
    for name, content in made.items():
        _look_into(desk, AskedScene(name, desk.out / name / SCENE, content), kept=True)


def is_bad(desk: Desk, step: Step, sentence: str) -> None:
    """A worker could not do it."""
    _tell(desk, SceneDone(step.asked.name, BAD, (sentence,)))


def variants_key(step: Step) -> str:
    """Of all that the further solutions of a scene depend on."""
    return hashed((step.key, step.asked.solutions))


def _look_into(desk: Desk, asked: AskedScene, *, kept: bool) -> None:
    """Find out what is to be done about a scene."""
    try:
        if asked.content is not None:
            _write(asked.file, asked.content)
        scene = load_scene(asked.file)
        key = desk.inputs.key(scene, desk.check, desk.report)
    except (MhveditError, OSError) as fault:
        _tell(desk, SceneDone(asked.name, BAD, (" ".join(str(fault).split()),)))
        return
    step = Step(asked, scene, key, kept)
    content = recorded(desk.out, asked.name, key)
    done = None if content is None else scene_done(content)
    if done is not None and holds(standing_in(desk.out / asked.name), done.files):
        is_finished(desk, step, done)
    else:
        desk.steps.append(step)


def _write(file: Path, content: str) -> None:
    """A scene file that is made; one that stands there as it is to be is left alone."""
    if file.exists() and file.read_text(encoding="utf-8") == content:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as beside:
        beside.write_text(content, encoding="utf-8")


def _tell(desk: Desk, done: SceneDone) -> None:
    desk.done[done.name] = done
    desk.told(done, len(desk.done), len(desk.known))
