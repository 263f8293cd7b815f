"""From solution groups to the edited scene of everybody on one stage."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mhvedit.geometry.arrays import IntArray
from mhvedit.pipeline.assemble import Assembly, assemble, lay_out
from mhvedit.pipeline.bodies import bodies_of, surroundings_of
from mhvedit.pipeline.clearing import kept_clear
from mhvedit.pipeline.depths import frames_in_question
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.settle import settled_rows
from mhvedit.pipeline.staging import on_stage
from mhvedit.pipeline.store import Store
from mhvedit.project.props import Prop
from mhvedit.project.schema import SceneFile


def arranged(
    scene: SceneFile,
    people: Mapping[str, Person],
    solved: Sequence[SolvedSegment],
    rows: Sequence[IntArray | None],
    *,
    fps: float,
    props: Mapping[str, Prop],
    store: Store,
    workers: int,
) -> Assembly:
    """Choose what everybody does where, carry everyone along it, and place all on the stage.

    Two people on an empty stage of no limits need no more than `assemble`.

    Args:
        scene: the scene file.
        people: by name.
        solved: key segments, in order.
        rows: (N,) of each segment, the solutions to choose from; None for all.
        fps: of the scene.
        props: by name.
        store: where shells are kept between runs.
        workers: threads; the result does not depend on it.

    Raises:
        NoSolution: a segment has no solution, adjoining ones have none in common, or there is no room on the stage.
    """
    line = lay_out(scene, people, fps)
    around = surroundings_of(scene, props, line.n_frames)
    if len(people) == 2 and around.empty and not scene.stage.marks and scene.stage.pin is None:
        found = assemble(scene, people, solved, fps=fps, rows=rows)
        wanted = frames_in_question(scene, found.scene, people)
        bodies = bodies_of(scene, people, line.sources, store, wanted=wanted)
        return kept_clear(scene, found, people=people, props={}, bodies=bodies, store=store, workers=workers)
    bodies = bodies_of(scene, people, line.sources, store)
    left, said = settled_rows(solved, rows, people=people, bodies=bodies, around=around, pin=scene.stage.pin)
    found = assemble(scene, people, solved, fps=fps, rows=left)
    edit = on_stage(scene, found.scene, people=people, bodies=bodies, around=around)
    if scene.stage.pin is not None and edit.cost > 0:
        said += (f"the cost and its bound are those without the pin: what {scene.stage.pin} keeps, the others change",)
    found = replace(found, scene=edit, notes=said)
    things = {name: props[name] for name in around.obstacles}
    everything = {**bodies, **around.obstacles}
    return kept_clear(scene, found, people=people, props=things, bodies=everything, store=store, workers=workers)
