"""After a change: what is searched again, and that the answer is what a run from nothing finds."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mhvedit import api
from mhvedit.pipeline import bodies, run, stages
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.run import Outcome, run_scene
from mhvedit.pipeline.terms import segment_clauses
from mhvedit.scene.shells import shell_of
from mhvedit.search.solve import SightTest, search_poses
from mhvedit.sequences.meshes import Mesh
from tests.pipeline.toy import LOWER_TABLE, RAISE_TABLE, Ran, files_of, write_scene

pytestmark = pytest.mark.usefixtures("unmeasured")
Command = Callable[..., Ran]
Change = tuple[str, str]
VISIBILITY: Change = ("visibility = {half_angle = 60}", "visibility = {half_angle = 35}")
BLIND: Change = ("visibility = {half_angle = 60}", "visibility = false")
NARROW: Change = ("window = 2.4", "window = 1.9")
WIDE: Change = ("window = 2.4", "window = 2.9")
WIDER: Change = ('name = "lower"', 'name = "lower"\nwindow = 2.9')
DEEP: Change = (LOWER_TABLE, LOWER_TABLE.replace("depth = 0.06", "depth = 0.08"))
NEAR: Change = (LOWER_TABLE, LOWER_TABLE.replace("voxels = 1", "voxels = 2"))


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by the number of poses that are asked for with every search that only asks who is in sight."""
    asked: list[int] = []
    search = stages.__dict__["search_poses"]

    def counted(grid: object, clauses: object, **options: object) -> object:
        if not clauses:
            asked.append(int(np.count_nonzero(np.asarray(options["among"]) == options["value"])))
        return search(grid, clauses, **options)

    monkeypatch.setattr(stages, "search_poses", counted)
    return asked


def same(a: Result, b: Result) -> None:
    """Every pose, every solution and the scene."""
    for one, other in zip(a.segments, b.segments, strict=True):
        assert one.found.reasons == other.found.reasons
        np.testing.assert_array_equal(one.found.reason, other.found.reason)
        for column in ("keys", "poses", "distance", "theta_a", "theta_b", "region", "clearance"):
            np.testing.assert_array_equal(getattr(one.group, column), getattr(other.group, column), column)
        np.testing.assert_array_equal(one.penalty, other.penalty)
        assert (one.counts, one.n_regions) == (other.counts, other.n_regions)
    assert (a.assembly is None) == (b.assembly is None)
    if a.assembly is not None and b.assembly is not None:
        assert a.assembly.chosen == b.assembly.chosen and a.assembly.scene.cost == b.assembly.scene.cost


@pytest.mark.parametrize("kept", ["on disk", "in memory", "both"])
@pytest.mark.parametrize(
    ("change", "searched"),
    [(VISIBILITY, []), (BLIND, []), (NARROW, []), (WIDE, [75, 75]), (WIDER, [75]), (DEEP, []), (NEAR, [63])],
    ids=["visibility", "blind", "narrow", "wide", "wider", "depth", "voxels"],
)
def test_a_change_finds_what_a_run_from_nothing_finds(
    folder: Path, searches: list[int], kept: str, change: Change, searched: list[int]
) -> None:
    cache = None if kept == "in memory" else folder / "out" / ".cache"
    before = api.solve(api.load(folder / "scene.toml", cache=cache))
    searches.clear()
    scene = write_scene(folder, change)
    after = api.solve(api.load(scene, cache=cache), previous=None if kept == "on disk" else before)
    assert searches == searched
    same(after, api.solve(api.load(scene)))


def test_three_searches_are_one(folder: Path) -> None:
    """The three maps, each of what the one before accepts, say what one search with all constraints says."""
    segment = api.solve(api.load(folder / "scene.toml")).segment("raise")
    a, b = segment.volumes()
    clauses = segment_clauses(segment.spec, a, b, pitch=segment.grid.step / segment.grid.stride)
    assert segment.stages.cones is not None
    at_once = search_poses(segment.grid, clauses, sight=SightTest(segment.stages.cones, a.body, b.body))
    assert at_once.reasons == segment.found.reasons and len(np.unique(at_once.reason)) > 4
    np.testing.assert_array_equal(at_once.reason, segment.found.reason)


def test_there_and_back_again(folder: Path, searches: list[int], looks: list[int]) -> None:
    """Larger, smaller, larger: what was decided once is not decided again."""
    first = api.solve(api.load(folder / "scene.toml", cache=folder / "cache"))
    for change in (WIDE, NARROW, (), WIDE, VISIBILITY, ()):
        scene = write_scene(folder, *((change,) if change else ()))
        last = api.solve(api.load(scene, cache=folder / "cache"))
    assert len(searches) == 4  # two segments in two windows
    accepted = first.segment("raise").counts
    rest = sum(count for reason, count in accepted.items() if "sight" in reason) + accepted["accepted"]
    assert looks == [rest, rest]  # at two angles; the rim of the larger window holds none to look at
    same(first, last)


@pytest.mark.parametrize("kept", ["on disk", "in memory"])
def test_a_pose_is_not_tested_again_because_another_contact_is_asked_for(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kept: str
) -> None:
    """A laxer contact accepts more: only these are tested for bodies and sight. A stricter one accepts less."""
    asked = {"bodies": 0, "sight": 0}
    search = stages.__dict__["search_poses"]

    def counted(grid: object, clauses: object, **options: object) -> object:
        if options["among"] is not None:
            asked["bodies" if clauses else "sight"] += int(
                np.count_nonzero(np.asarray(options["among"]) == options["value"])
            )
        return search(grid, clauses, **options)

    def solved(change: tuple[Change, ...], previous: Result | None = None) -> tuple[Result, dict[str, int]]:
        asked.update(bodies=0, sight=0)
        cache = folder / "cache" if kept == "on disk" else None
        result = api.solve(api.load(write_scene(folder, *change), cache=cache), workers=1, previous=previous)
        return result, dict(asked)

    monkeypatch.setattr(stages, "search_poses", counted)
    lax = RAISE_TABLE, RAISE_TABLE.replace("voxels = 1", "voxels = 2")
    first, few = solved(())
    second, more = solved((lax,), None if kept == "on disk" else first)
    third, again = solved((), None if kept == "on disk" else second)
    assert more["bodies"] > 0 and again == {"bodies": 0, "sight": 0}
    asked.update(bodies=0, sight=0)
    afresh = api.solve(api.load(write_scene(folder, lax)), workers=1)
    assert {kind: few[kind] + more[kind] for kind in few} == asked
    same(second, afresh)
    same(third, first)


def test_a_shell_is_not_made_again_because_other_frames_are_in_question(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of every frame once, whatever else is asked for; and those of one frame do not depend on it."""
    job = api.load(folder / "scene.toml", cache=folder / "cache")
    people = meet_people(job.scene, job.subjects, job.store)
    made: list[Mesh] = []

    def counted(mesh: Mesh) -> NDArray[np.float32]:
        made.append(mesh)
        return shell_of(mesh)

    monkeypatch.setattr(bodies, "shell_of", counted)
    numbers = np.array(people["anna"].sequence.numbers)
    for asked in ([4, 5, 9], [2, 4, 5], [9, 2], list(range(12))):
        wanted = np.isin(np.arange(len(numbers)), asked)
        one = bodies.bodies_of(job.scene, people, {"anna": numbers}, job.store, wanted={"anna": wanted})["anna"]
        assert np.array_equal(one.rows >= 0, wanted)
        for frame in asked:
            shell = shell_of(people["anna"].sequence.mesh(int(numbers[frame])))
            np.testing.assert_array_equal(one.shells.of(int(one.rows[frame])), shell)
    assert len(made) == 12


def test_what_did_not_change_is_taken_over(folder: Path) -> None:
    before = api.solve(api.load(folder / "scene.toml"))
    after = api.solve(api.load(write_scene(folder, DEEP)), previous=before)
    assert after.segment("raise") is before.segment("raise")
    assert after.segment("lower") is not before.segment("lower")


def test_a_long_session_holds_no_more_than_it_needs(folder: Path) -> None:
    result = api.solve(api.load(folder / "scene.toml"))
    sizes = []
    for step in range(4):
        change = VISIBILITY[0], f"visibility = {{half_angle = {40 + step}}}"
        result = api.solve(api.load(write_scene(folder, change)), previous=result)
        sizes.append(len(result.job.store.used))
    assert sizes[1:] == sizes[:1] * 3


def test_only_the_changed_solutions_are_written(folder: Path) -> None:
    out = folder / "out"
    run_scene(folder / "scene.toml", out, report=False)
    before = {path.name: path.stat().st_mtime_ns for path in (out / "solutions").iterdir()}
    run_scene(write_scene(folder, DEEP), out, report=False)
    after = {path.name: path.stat().st_mtime_ns for path in (out / "solutions").iterdir()}
    assert after["raise.npz"] == before["raise.npz"] and after["lower.npz"] != before["lower.npz"]


def test_the_answer_comes_first(folder: Path) -> None:
    """When it is told, its files stand there, and no report on an earlier one does."""
    out = folder / "out"
    run_scene(folder / "scene.toml", out, report=False)
    (out / "report.html").write_text("of the earlier answer")
    earlier = files_of(out)["edit.json"]
    told: list[Outcome] = []

    def look(outcome: Outcome) -> None:
        told.append(outcome)
        report = json.loads((out / "report.json").read_text())
        assert report == outcome.report and report["check"] is None and "mhvedit check" in report["unchecked"]
        assert report["answer_seconds"] > 0 and not (out / "report.html").exists()
        assert files_of(out)["edit.json"] != earlier or report["segments"][1]["solutions"] > 0

    finished = run_scene(write_scene(folder, DEEP), out, report=False, answered=look)
    assert len(told) == 1 and finished.report["check"] is not None and finished.report["unchecked"] is None


def test_the_answer_only(mhvedit: Command, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")
    with monkeypatch.context() as patch:
        patch.setattr(run, "measure_scene", None)
        for _ in range(2):
            ran = mhvedit(*words, "--answer-only")
            assert ran.code == 0 and ran.err == ""
            assert f"not been checked on the meshes yet: `mhvedit check {folder / 'out'}`" in ran.out
    assert json.loads((folder / "out" / "report.json").read_text())["check"] is None
    before = (folder / "out" / "edit.json").stat().st_mtime_ns
    assert "deepest penetration" in mhvedit(*words).out
    assert (folder / "out" / "edit.json").stat().st_mtime_ns == before
    assert json.loads((folder / "out" / "report.json").read_text())["check"] is not None


def test_ctrl_c_in_the_check(
    mhvedit: Command, folder: Path, searches: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The answer stands; the next run only checks it."""
    words = ("solve", folder / "scene.toml", "-o", folder / "out", "--no-report")

    def interrupted(*scene: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(run, "measure_scene", interrupted)
        ran = mhvedit(*words)
    assert (ran.code, ran.sentence) == (130, "interrupted; the next run goes on from here")
    assert "cost 0 m²" in ran.out
    before, made = files_of(folder / "out"), len(searches)
    assert json.loads(before["report.json"])["check"] is None and "edit.json" in before
    assert mhvedit(*words).code == 0 and len(searches) == made
    after = files_of(folder / "out")
    assert {name for name in after if after[name] != before[name]} == {"report.json"}
