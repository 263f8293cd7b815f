"""More than two: Anna meets Ben with her right hand, and Carl with her left one; others come and go."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, compose, invert, wrap_angle
from mhvedit.pipeline import clearing
from mhvedit.pipeline.assemble import assemble
from mhvedit.pipeline.depths import Movers
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.measure import measure_scene
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.report import SceneReport, Thresholds, failures
from tests.pipeline.toy import ANNA, BEN, CORNERS, FACES, LOWER_TABLE, N_FRAMES, SCENE, Actor, obj_text, write_actor

CARL = Actor(long=0.53, place=(4.0, 1.0, 2.2))
DORA = Actor(long=0.50, place=(-3.0, 0.5, 0.3))
BOTH_ARMS = replace(ANNA, left_from=8)
CAST = {"anna": BOTH_ARMS, "ben": BEN, "carl": CARL}


def subject(name: str) -> str:
    """A subject's tables."""
    start, stop = SCENE.index("[subjects.ben]"), SCENE.index("[[segments]]")
    return SCENE[start:stop].replace("ben", name)


def lower(a: str, b: str, name: str = "lower") -> str:
    """The second segment, of others."""
    table = LOWER_TABLE.replace('name = "lower"', f'name = "{name}"')
    return (
        table.replace('"anna"', f'"{a}"')
        .replace('"ben"', f'"{b}"')
        .replace("anna =", f"{a} =")
        .replace("ben =", f"{b} =")
    )


def content(*segments: str, more: tuple[str, ...] = ("carl",), stage: str = "") -> str:
    """A scene file in which the first segment is Anna's and Ben's."""
    head, tail = SCENE.split(LOWER_TABLE)
    subjects = "".join(subject(name) for name in more)
    return head.replace("[[segments]]", subjects + "[[segments]]", 1) + "".join(segments) + stage + tail


def solve(folder: Path, text: str, **cast: Actor) -> Result:
    folder.mkdir(exist_ok=True)
    for name, actor in (CAST | cast).items():
        write_actor(folder, name, actor)
    (folder / "scene.toml").write_text(text)
    return api.solve(api.load(folder / "scene.toml"))


def edit_of(result: Result) -> EditedScene:
    assert result.assembly is not None, result.failure
    return result.assembly.scene


def measured(result: Result) -> SceneReport:
    return measure_scene(result.job, result.people, edit_of(result))


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return solve(tmp_path_factory.mktemp("three"), content(lower("anna", "carl")))


def test_all_segments_stand_as_chosen(three: Result) -> None:
    edit = edit_of(three)
    assert list(edit.subjects) == ["anna", "ben", "carl"] and edit.cost == 0
    for segment in edit.segments:
        a, b = (edit.subjects[name].placements[segment.start : segment.stop] for name in segment.between)
        off = compose(invert(a), b) - segment.relative
        np.testing.assert_allclose(off[:, :2], 0, atol=1e-9)
        np.testing.assert_allclose(wrap_angle(off[:, 2]), 0, atol=1e-9)


def test_everybody_is_clear_of_everybody(three: Result) -> None:
    report = measured(three)
    assert [pair.between for pair in report.pairs] == list(combinations(["anna", "ben", "carl"], 2))
    assert report.pairs[2].deepest == 0
    assert max(pair.deepest for pair in report.pairs) < 0.07  # hands and arms of a segment may sink by so much


def test_who_has_too_few_frames_stands_still(three: Result) -> None:
    line = three.assembly.line if three.assembly else None
    assert line is not None and line.n_frames == N_FRAMES
    assert all(len(source) == N_FRAMES for source in line.sources.values())


def test_a_third_ones_capture_may_stand_anywhere(tmp_path: Path) -> None:
    stands = []
    for n, place in enumerate([(0.0, 0.0, 0.0), (0.13, 0.07, 0.0), (0.13, 0.07, 1.3)]):
        text = content(lower("anna", "carl")).replace("visibility = {half_angle = 60}", "visibility = false")
        result = solve(tmp_path / str(n), text, anna=ANNA, carl=replace(CARL, place=place))
        poses = {name: compose(edit_of(result).subjects[name].placements[0], result.people[name].pose) for name in CAST}
        stands.append([compose(invert(poses["anna"]), poses[name]) for name in ("ben", "carl")])
    away = np.array(stands) - stands[0]
    np.testing.assert_allclose(away[..., :2], 0, atol=1e-6)
    np.testing.assert_allclose(wrap_angle(away[..., 2]), 0, atol=1e-6)


def test_two_pairs_share_a_stage(tmp_path: Path) -> None:
    result = solve(tmp_path, content(lower("carl", "dora"), more=("carl", "dora")), anna=ANNA, dora=DORA)
    report = measured(result)
    strangers = [pair for pair in report.pairs if set(pair.between) not in ({"anna", "ben"}, {"carl", "dora"})]
    assert len(strangers) == 4 and all(pair.deepest == 0 for pair in strangers)


def test_how_strangers_stand_does_not_depend_on_their_captures(tmp_path: Path) -> None:
    stands = []
    for n, moved in enumerate(
        [{}, {"anna": (1.31, -0.24, 2.4)}, {"carl": (4.13, 1.07, -0.4), "dora": (1.0, 0.0, 2.0)}]
    ):
        cast = {"anna": ANNA, "ben": BEN, "carl": CARL, "dora": DORA}
        cast = {name: replace(actor, place=moved.get(name, actor.place)) for name, actor in cast.items()}
        result = solve(tmp_path / str(n), content(lower("carl", "dora"), more=("carl", "dora")), **cast)
        poses = {name: compose(edit_of(result).subjects[name].placements[0], result.people[name].pose) for name in cast}
        stands.append([compose(invert(poses["anna"]), pose) for pose in poses.values()])
    away = np.array(stands) - stands[0]
    np.testing.assert_allclose(away[..., :2], 0, atol=1e-6)
    np.testing.assert_allclose(wrap_angle(away[..., 2]), 0, atol=1e-6)


# The stage


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> str:
    """A box as OBJ."""
    return obj_text((np.array(low) + CORNERS * (np.array(high) - np.array(low)), FACES))


def plan(result: Result, name: str) -> FloatArray:
    """(K, 2) all vertices of somebody through the scene, in plan."""
    edit, sequence = edit_of(result).subjects[name], result.people[name].sequence
    placed = [
        apply_pose(pose, sequence.mesh(int(n)).vertices) for n, pose in zip(edit.source, edit.placements, strict=True)
    ]
    return np.concatenate(placed)[:, :2]


def solve_two(folder: Path, stage: str, **cast: Actor) -> Result:
    folder.mkdir(exist_ok=True)
    (folder / "pillar.obj").write_text(box((-0.2, -0.2, 0.0), (0.2, 0.2, 1.8)))
    return solve(folder, content(lower("anna", "ben"), more=(), stage=stage), **({"anna": ANNA} | cast))


def test_the_pinned_one_stands_as_captured(tmp_path: Path) -> None:
    result = solve_two(tmp_path, '[stage]\npin = "ben"\n')
    np.testing.assert_array_equal(edit_of(result).subjects["ben"].placements, 0)
    assert measured(result).segments[0].verdict.agrees


def test_the_map_says_what_the_stage_rejects(tmp_path: Path) -> None:
    free = solve_two(tmp_path / "free", '[stage]\npin = "anna"\n')
    ben = plan(free, "ben")
    x, y = ben.mean(0)
    prop = f'[stage]\npin = "anna"\n[props.pillar]\npath = "pillar.obj"\nplace = [{x}, {y}, 0]\n'
    pillar = solve_two(tmp_path / "prop", prop)
    anna = plan(free, "anna")
    corners = [[anna[:, i].min() - 0.05 for i in (0, 1)], [anna[:, i].max() + 0.05 for i in (0, 1)]]
    (x0, y0), (x1, y1) = np.round(corners, 3).tolist()
    floor = f'[stage]\npin = "anna"\nfloor = [[{x0}, {y0}], [{x1}, {y0}], [{x1}, {y1}], [{x0}, {y1}]]\n'
    small = solve_two(tmp_path / "floor", floor)
    for result, reason in ((pillar, "prop pillar"), (small, "stage")):
        segment = result.segment("raise")
        assert segment.counts[reason] > 0
        left = {tuple(key) for key in segment.group.keys.tolist()}
        assert left < {tuple(key) for key in free.segment("raise").group.keys.tolist()}
    assert small.assembly is None  # there is room for Anna alone
    report = measured(pillar)
    assert [pair.between for pair in report.pairs] == [("anna", "ben"), ("anna", "pillar"), ("ben", "pillar")]
    assert all(pair.deepest == 0 for pair in report.pairs[1:])


def test_a_floor_counts_however_small_the_first_window_was(tmp_path: Path) -> None:
    """In a small one there is nothing that is not floor."""
    for name, actor in (("anna", ANNA), ("ben", BEN)):
        write_actor(tmp_path, name, actor)
    (tmp_path / "scene.toml").write_text(content(LOWER_TABLE, more=()))
    free = api.solve(api.load(tmp_path / "scene.toml"))
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 1.1
    around = square + np.append(free.segment("raise").grid.root_a, 0.0)
    floor = apply_pose(free.people["anna"].pose, around)[:, :2].round(4).tolist()
    cache = tmp_path / "cache"

    def solved(window: float, angle: int, kept: Path | None) -> Result:
        text = content(LOWER_TABLE, more=(), stage=f'[stage]\npin = "anna"\nfloor = {floor}\n')
        text = text.replace("window = 2.4", f"window = {window}").replace("half_angle = 60", f"half_angle = {angle}")
        (tmp_path / "scene.toml").write_text(text)
        return api.solve(api.load(tmp_path / "scene.toml", cache=kept))

    assert solved(0.4, 60, cache).segment("raise").counts["stage"] == 0
    for window, angle in ((2.4, 60), (2.4, 61)):
        warm, cold = solved(window, angle, cache).segment("raise"), solved(window, angle, None).segment("raise")
        assert warm.counts == cold.counts and cold.counts["stage"] > 0


def test_everybody_stays_on_the_floor_and_out_of_props(tmp_path: Path) -> None:
    stage = """
[stage]
floor = [[-2, -1], [2, -1], [2, 1], [0, 1], [0, 3], [-2, 3]]
[props.pillar]
path = "pillar.obj"
place = [0.5, 0, 30]
"""
    result = solve_two(tmp_path, stage)
    for name in ("anna", "ben"):
        x, y = plan(result, name).T
        assert (np.abs(x) <= 2).all() and (y >= -1).all() and (y <= 3).all() and not ((x > 0) & (y > 1)).any()
    report = measured(result)
    assert all(pair.deepest == 0 for pair in report.pairs[1:])
    assert report.off_floor == {"anna": (), "ben": ()}


def test_the_check_says_who_leaves_the_floor(tmp_path: Path) -> None:
    result = solve_two(tmp_path, "[stage]\nfloor = [[-5, -5], [5, -5], [5, 5], [-5, 5]]\n")
    edit = edit_of(result)
    ben = edit.subjects["ben"]
    astray = ben.placements.copy()
    astray[4:6, 0] += 20
    report = measure_scene(
        result.job, result.people, replace(edit, subjects={**edit.subjects, "ben": replace(ben, placements=astray)})
    )
    assert report.off_floor == {"anna": (), "ben": (4, 5)}
    assert "stage: ben leaves the floor in frames 4-5" in failures(report, Thresholds())


def test_no_room_is_an_answer(tmp_path: Path) -> None:
    result = solve_two(tmp_path, "[stage]\nfloor = [[0, 0], [1, 0], [0, 1]]\n")
    assert result.assembly is None and "no room" in str(result.failure)


def test_marks_place_the_group(tmp_path: Path) -> None:
    mark = '[[stage.marks]]\nsubject = "ben"\nframe = 7\nat = [3, -2]\nfacing = 90\n'
    result = solve_two(tmp_path, mark)
    edit, ben = edit_of(result).subjects["ben"], result.people["ben"]
    at = apply_pose(edit.placements[7], ben.centres_at(np.array([7]))[0])
    np.testing.assert_allclose(at, [3, -2], atol=1e-9)
    assert wrap_angle(edit.placements[7, 2] + ben.facing.yaw[7] - np.pi / 2) == pytest.approx(0, abs=1e-9)


def test_marks_that_contradict_the_motion(tmp_path: Path) -> None:
    marks = "".join(
        f'[[stage.marks]]\nsubject = "ben"\nframe = {frame}\nat = [{x}, 0]\n' for frame, x in ((3, 0), (12, 5))
    )
    result = solve_two(tmp_path, marks)
    assert result.assembly is None and "stage.marks[0] is missed by 2.5" in str(result.failure)


# Between key segments


def test_paths_give_way(tmp_path: Path) -> None:
    """Ben walks on into Anna after their hands have met."""
    for name, actor in (("anna", ANNA), ("ben", replace(BEN, walk=(0.1, 0.0)))):
        write_actor(tmp_path, name, actor)
    (tmp_path / "scene.toml").write_text(content(more=()))
    result = api.solve(api.load(tmp_path / "scene.toml"))
    assert result.assembly is not None
    straight = assemble(result.job.scene, result.people, result.segments, fps=result.job.fps)
    assert straight.bends == () and straight.chosen == result.assembly.chosen
    (bend,) = result.assembly.bends
    assert bend.before_mm > 100 and bend.after_mm <= bend.allowed_mm == 60 and bend.cost > 0
    before, after = (measure_scene(result.job, result.people, own.scene) for own in (straight, result.assembly))
    assert before.deepest == pytest.approx(bend.before_mm / 1000, abs=1e-6)
    assert after.deepest <= 0.06
    for name in ("anna", "ben"):
        one, other = (own.scene.subjects[name].placements for own in (straight, result.assembly))
        np.testing.assert_array_equal(one[:7], other[:7])
        assert np.abs(np.diff(other - one, 2, axis=0)).max() < 0.05  # no jump


def test_what_cannot_be_cleared_keeps_nothing_else_from_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same, told twice: away from Anna, and right through her, which would take too much."""
    for name, actor in (("anna", ANNA), ("ben", replace(BEN, walk=(0.1, 0.0)))):
        write_actor(tmp_path, name, actor)
    (tmp_path / "scene.toml").write_text(content(more=()))
    result = api.solve(api.load(tmp_path / "scene.toml"))
    runs_of = clearing._runs

    def twice(movers: Movers, pair: tuple[str, str], depth: FloatArray) -> list[clearing._Run]:
        return [replace(run, direction=s * run.direction) for run in runs_of(movers, pair, depth) for s in (-1, 1)]

    monkeypatch.setattr(clearing, "_runs", twice)
    monkeypatch.setattr(clearing, "FURTHEST", 0.3)
    again = api.choose(result, {}).assembly
    assert result.assembly is not None and again is not None and len(again.bends) == 2
    for name, edit in again.scene.subjects.items():
        np.testing.assert_array_equal(edit.placements, result.assembly.scene.subjects[name].placements)
    monkeypatch.setattr(clearing, "FURTHEST", 0.01)
    stiff = api.choose(result, {}).assembly
    assert stiff is not None and all(bend.after_mm == bend.before_mm > 100 for bend in stiff.bends)


def test_nothing_gives_way_where_nobody_is_too_deep(three: Result) -> None:
    assert three.assembly is not None and three.assembly.bends == ()
