from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mhvedit.constraints.dictionary import InteractionType, Slack, temporal_clauses
from mhvedit.scene.edit import EditedScene, SegmentEdit, SubjectEdit
from mhvedit.scene.eyes import eyes_in
from mhvedit.search.groups import SolutionGroup, solution_group
from mhvedit.search.poses import pose_grid
from mhvedit.search.solve import ReasonMap, search_poses
from mhvedit.sequences.meshes import Gaze, MeshSequence
from mhvedit.view.charts import SceneCheck
from mhvedit.view.content import CaptureStory, ReportContent, SegmentStory, StorySide
from tests.view.shapes import N_FRAMES, PITCH, person, standing, sweep

StoryMaker = Callable[[str], SegmentStory]


@pytest.fixture(scope="session")
def found() -> ReasonMap:
    a, b = sweep(1), sweep(-1)
    clauses = temporal_clauses(InteractionType.END_END, a, b, slack=Slack(1, 1.0))
    grid = pose_grid(np.zeros(2), np.zeros(2), pitch=PITCH, stride=1, n_yaw=24, window=2.4)
    return search_poses(grid, clauses)


@pytest.fixture(scope="session")
def group(found: ReasonMap) -> SolutionGroup:
    return solution_group(found, facing_a=0.0, facing_b=np.pi, lever=0.5)


@pytest.fixture(scope="session")
def nothing(found: ReasonMap) -> ReasonMap:
    return ReasonMap(found.grid, np.where(found.reason == 0, 2, found.reason).astype(np.uint8), found.reasons)


@pytest.fixture(scope="session")
def captures() -> dict[str, MeshSequence]:
    numbers = tuple(range(20))
    return {name: MeshSequence(name, numbers, 25.0, lambda number: person(0.02 * number)) for name in ("anna", "ben")}


@pytest.fixture(scope="session")
def scene() -> EditedScene:
    source = np.arange(20)
    left, right = np.tile([-0.6, 0.0, 0.0], (20, 1)), np.tile([0.6, 0.0, np.pi], (20, 1))
    named = [("meet", 2, 2 + N_FRAMES), ("part", 11, 11 + N_FRAMES)]
    segments = tuple(
        SegmentEdit(name, start, stop, "+&+", ("anna", "ben"), 1.2, 0.0, 0.0, np.array([1.2, 0.0, np.pi]))
        for name, start, stop in named
    )
    subjects = {"anna": SubjectEdit(source, left), "ben": SubjectEdit(source, right)}
    return EditedScene("greeting", 25.0, 20, subjects, segments, 0.02, 0.019, 5.0)


@pytest.fixture(scope="session")
def check() -> SceneCheck:
    depth = np.zeros(20)
    depth[7] = 28.0
    skate = {"anna": np.full(20, 0.01), "ben": np.zeros(20)}
    return SceneCheck(depth, np.where(depth > 0, 0.0, 100.0), depth > 0, skate)


@pytest.fixture(scope="session")
def make_story(found: ReasonMap, group: SolutionGroup) -> StoryMaker:
    def make(name: str) -> SegmentStory:
        a = StorySide("anna", "hand", (0, 7), 0.0, sweep(1), standing())
        b = StorySide("ben", "hand", (2, 9), np.pi, sweep(-1), standing())
        chosen = int(group.clearance.argmax())
        return SegmentStory(name, "+&+", a, b, N_FRAMES, found, group, chosen)

    return make


@pytest.fixture(scope="session")
def content(
    make_story: StoryMaker,
    nothing: ReasonMap,
    scene: EditedScene,
    captures: dict[str, MeshSequence],
    check: SceneCheck,
) -> ReportContent:
    empty = replace(
        make_story("part"),
        found=nothing,
        group=solution_group(nothing, facing_a=0.0, facing_b=0.0, lever=0.5),
        chosen=None,
        killed_by="“no contact” rejects all.",
        nearest="The nearest pose misses by 14 mm.",
    )
    forward = Gaze(np.arange(20), np.tile([0.15, 0.0, 1.6], (20, 1)), np.tile([1.0, 0.0, 0.0], (20, 1)))
    eyes = {name: eyes_in(name, edit, forward) for name, edit in scene.subjects.items()}
    about = CaptureStory("anna", {"faces": "12"}, "estimated", 0.4, "given", ("watertight <everywhere>",))
    return ReportContent(
        "a <b>greeting</b>", (make_story("meet"), empty), scene, captures, check=check, limit_mm=30.0, eyes=eyes,
        centres={name: np.linspace([0.0, 0.0], [0.4, 0.0], 20) for name in captures}, about=(about,),
        warnings=("ben lies on its side",), settings={"voxel": "50 mm"}, stage_seconds={"search": 2.0},
    )  # fmt: skip
