"""Whole scenes of balls and boxes: what is measured where, thresholds, sight, things held, three people, sub-steps."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mhvedit.constraints.visibility import SightCone
from mhvedit.errors import MissingFrame, ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.scene.checks import SegmentSight, check_scene
from mhvedit.scene.contact import ContactSlack
from mhvedit.scene.edit import EditedScene, SegmentEdit, SubjectEdit
from mhvedit.scene.report import SceneReport, Thresholds, failures, report_as_dict
from mhvedit.sequences.meshes import Mesh, MeshSequence

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
N = 8


def capture(name: str, n: int = N, radius: float = 0.3) -> MeshSequence:
    """A ball that stands on the floor at the origin."""
    size = radius / 0.3
    mesh = Mesh(BALL.vertices * size + np.array([0, 0, radius]), BALL.faces.astype(np.int32))
    return MeshSequence(name, tuple(range(10, 10 + n)), 25.0, lambda _: mesh)


def blade(name: str, n: int = N) -> MeshSequence:
    """A flat bar from x = 0.25 to x = 1.25 at z = 0.3."""
    box = trimesh.creation.box(extents=(1.0, 0.04, 0.01))
    mesh = Mesh(np.asarray(box.vertices) + np.array([0.75, 0, 0.3]), box.faces.astype(np.int32))
    return MeshSequence(name, tuple(range(10, 10 + n)), 25.0, lambda _: mesh)


def at(x: FloatArray | float, y: FloatArray | float = 0.0, yaw: FloatArray | float = 0.0) -> FloatArray:
    return np.stack([np.broadcast_to(np.asarray(v, np.float64), N) for v in (x, y, yaw)], 1)


def segment(name: str, start: int, stop: int, interaction: str, between: tuple[str, str] = ("a", "b")) -> SegmentEdit:
    return SegmentEdit(name, start, stop, interaction, between, 0.0, 0.0, 0.0, np.zeros(3))


def scene(places: dict[str, FloatArray], *segments: SegmentEdit) -> EditedScene:
    subjects = {name: SubjectEdit(np.arange(10, 10 + N), place) for name, place in places.items()}
    return EditedScene("toy", 25.0, N, subjects, segments, 0.0, 0.0, 0.0)


def upper_half(subject: str, part: str, number: int, mesh: Mesh) -> BoolArray:
    assert part == "top" and number >= 10 and subject in "abc"
    return np.asarray(mesh.vertices[:, 2] > 0.3)


def check(edit: EditedScene, *, parts: tuple[str, str] = ("body", "body"), steps: int = 0) -> SceneReport:
    captures = {name: capture(name) for name in edit.subjects}
    asked = {s.name: parts for s in edit.segments}
    return check_scene(
        edit, captures, part_vertices=upper_half, parts_of_segment=asked, between_frames=steps
    )  # fmt: skip


APPROACH = np.array([1.25, 1.0, 0.8, 0.7, 0.62, 0.58, 0.7, 0.9])  # 20 mm deep in frame 5


def test_depth_and_gap_of_every_frame() -> None:
    report = check(scene({"a": at(0.0), "b": at(APPROACH)}))
    gap = report.pairs[0].gap
    near = APPROACH - 0.6 < 0.25
    assert gap[near] == pytest.approx((APPROACH - 0.6)[near], abs=3e-3)
    assert np.isinf(gap[~near]).all()
    assert report.pairs[0].crossing.tolist() == [k == 5 for k in range(N)]
    assert report.deepest == pytest.approx(0.02, abs=3e-3) and report.pairs[0].deepest_frame == 5
    assert report.pairs[0].where[5] == pytest.approx([0.29, 0, 0.3], abs=0.05)
    assert report.pairs[0].solids[5] == ("body", "body") and report.pairs[0].solids[0] is None


def test_a_segment_says_where_and_when_its_parts_touch() -> None:
    edit = scene({"a": at(0.0), "b": at(APPROACH)}, segment("hit", 2, 6, "+&0"))
    for parts in (("body", "body"), ("top", "top"), ("top", "body")):
        found = check(edit, parts=parts).segments[0]
        assert found.contact_frames == (5,), parts
        assert found.verdict.agrees, found.verdict.sentence
        assert found.part_place[3] == pytest.approx([0.29, 0, 0.3], abs=0.06)
        assert found.deepest == pytest.approx(0.02, abs=3e-3)
        assert found.reach_gap[3] == pytest.approx(found.part_gap[3], abs=8e-3)


def test_the_roles_may_be_told_the_other_way_round() -> None:
    edit = scene({"a": at(0.0), "b": at(APPROACH)}, segment("hit", 2, 6, "0&+", ("b", "a")))
    found = check(edit, parts=("top", "body")).segments[0]
    assert found.verdict.agrees and found.contact_frames == (5,)


def test_moving_and_turning_the_whole_scene_changes_nothing() -> None:
    still = check(scene({"a": at(0.0), "b": at(APPROACH)}, segment("hit", 2, 6, "+&+")), parts=("top", "top"))
    c, s = np.cos(0.7), np.sin(0.7)
    moved = scene(
        {"a": at(3.0, -2.0, 0.7), "b": at(3.0 + c * APPROACH, -2.0 + s * APPROACH, 0.7)}, segment("hit", 2, 6, "+&+")
    )
    turned = check(moved, parts=("top", "top"))
    assert turned.pairs[0].gap == pytest.approx(still.pairs[0].gap, abs=1e-5)
    assert turned.segments[0].verdict.agrees == still.segments[0].verdict.agrees


def test_the_same_scene_gives_the_same_report() -> None:
    edit = scene({"a": at(0.0), "b": at(APPROACH)}, segment("hit", 2, 6, "+&+"))
    assert report_as_dict(check(edit)) == report_as_dict(check(edit))


def test_thresholds_say_which_where_and_by_how_much() -> None:
    slide = at(APPROACH)
    edit = scene({"a": at(0.0), "b": slide}, segment("early", 0, 3, "0&0b"), segment("hit", 5, 6, "none"))
    report = check(edit)
    assert failures(report, Thresholds(skate_mps=9, step_mm=900, jump_mps=90, types=False)) == ()
    said = failures(report, Thresholds(penetration_mm=5))
    kinds = [sentence.split(":")[0] for sentence in said]
    assert kinds == ["penetration", "contact", "contact", "skate", "step", "jump"]
    assert "a and b" in said[0] and "frame 5 (segment hit)" in said[0] and "over the 5 mm allowed" in said[0]
    assert "segment early" in said[1] and "segment hit" in said[2]
    assert "b: soles are moved by 6.25 m/s from frame 0 to 1" in said[3]
    assert "b: the edit lengthens the step by 250.00 mm" in said[4] and "200.00 mm over the 50 mm" in said[4]


def test_transitional_frames_are_looked_at_and_named() -> None:
    edit = scene({"a": at(0.0), "b": at(APPROACH)}, segment("early", 0, 2, "none"), segment("late", 7, 8, "none"))
    said = failures(check(edit), Thresholds(penetration_mm=5, skate_mps=9, step_mm=900, jump_mps=90))
    assert len(said) == 1 and "frame 5 (between early and late)" in said[0]


def test_turns_are_measured_in_degrees() -> None:
    turning = at(2.0, 0.0, np.radians([0, 2, 4, 6, 30, 32, 34, 36]))
    report = check(scene({"a": at(0.0), "b": turning}))
    assert report_as_dict(report)["motions"]["b"]["turn"] == {"deg": pytest.approx(24), "frame": 3}
    assert any("turn: b" in s and "from frame 3 to 4" in s for s in failures(report, Thresholds()))


def test_three_people_are_checked_in_pairs() -> None:
    edit = scene({"a": at(0.0), "b": at(0.59), "c": at(0.0, 0.57)}, segment("m", 0, N, "0&0a", ("a", "c")))
    report = check(edit)
    assert [pair.between for pair in report.pairs] == [("a", "b"), ("a", "c"), ("b", "c")]
    deep = [pair.deepest for pair in report.pairs]
    assert deep == pytest.approx([0.01, 0.03, 0.0], abs=3e-3)
    assert report.segments[0].verdict.agrees
    assert [m.subject for m in report.motions] == ["a", "b", "c"]


def test_what_is_held_is_solid_and_can_be_a_part() -> None:
    edit = scene({"a": at(0.0), "b": at(1.6, 0.013, np.pi + 0.01)}, segment("cross", 0, N, "0&0a"))
    captures = {name: capture(name) for name in "ab"}
    report = check_scene(
        edit,
        captures,
        part_vertices=upper_half,
        parts_of_segment={"cross": ("sword", "sword")},
        held={"a": {"sword": blade("a")}, "b": {"sword": blade("b")}},
    )
    assert report.pairs[0].solids[0] == ("sword", "sword") and report.pairs[0].crossing.all()
    assert report.segments[0].verdict.agrees
    stab = scene({"a": at(0.0), "b": at(1.4)})
    found = check_scene(
        stab,
        captures,
        part_vertices=upper_half,
        parts_of_segment={},
        held={"a": {"sword": blade("a")}},
    ).pairs[0]
    assert found.deepest == pytest.approx(0.15, abs=0.01) and found.solids[0] == ("sword", "body")


def test_sight_is_asked_in_the_frames_that_were_named() -> None:
    along, half = np.array([1.0, 0, 0]), np.radians(40)
    cone = SightCone(np.array([0.0, 0, 0.5]), along, half)
    facing, away = at(2.0, 0.0, np.pi), at(2.0)
    for placed, holds in ((facing, True), (away, False)):
        edit = scene({"a": at(0.0), "b": placed}, segment("look", 2, 7, "none"))
        report = check_scene(
            edit,
            {name: capture(name) for name in "ab"},
            part_vertices=upper_half,
            parts_of_segment={"look": ("body", "body")},
            sight={"look": SegmentSight(cone, cone, first=1, stop=3)},
        )
        sight = report.segments[0].sight
        assert sight is not None and sight.holds == holds
        assert (sight.first, sight.a_sees_b, sight.b_sees_a) == (3, (True, True), (holds, holds))
        said = failures(report, Thresholds())
        assert said == (() if holds else ("sight: segment look (a and b, frames 2-6): b never sees a",))


def test_sub_steps_see_people_pushed_through_each_other() -> None:
    through = at(np.where(np.arange(N) < 4, -0.7, 0.7))
    edit = scene({"a": at(0.0), "b": through})
    blind, seeing = check(edit), check(edit, steps=3)
    assert blind.deepest == 0 and blind.pairs[0].between_gap is None
    between = seeing.pairs[0].between_gap
    assert between is not None and between.shape == (N - 1,)
    assert between[3] == pytest.approx(-0.25, abs=0.01) and np.isinf(np.delete(between, 3)).all()
    assert any("between frames 3 and 4" in s for s in failures(seeing, Thresholds()))


def test_tolerances_reach_the_verdict() -> None:
    edit = scene({"a": at(0.0), "b": at(0.615)}, segment("hold", 0, N, "0&0a"))
    captures = {name: capture(name) for name in "ab"}
    strict = check_scene(edit, captures, part_vertices=upper_half, parts_of_segment={"hold": ("body", "body")})
    loose = check_scene(
        edit,
        captures,
        part_vertices=upper_half,
        parts_of_segment={"hold": ("body", "body")},
        slack={"hold": ContactSlack(near=0.02)},
    )
    assert not strict.segments[0].verdict.agrees and loose.segments[0].verdict.agrees


def test_the_report_is_plain_json() -> None:
    edit = scene({"a": at(0.0), "b": at(APPROACH)}, segment("hit", 2, 6, "+&0"))
    plain = report_as_dict(check(edit, steps=1))
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["segments"][0]["touch"] == "...#" and plain["pairs"][0]["gap_mm"][0] is None
    assert plain["pairs"][0]["deepest_in"] == "segment hit"


def test_progress_is_told() -> None:
    told: list[tuple[int, int]] = []
    edit = scene({"a": at(0.0)})
    report = check_scene(
        edit,
        {"a": capture("a")},
        part_vertices=upper_half,
        parts_of_segment={},
        progress=lambda done, total: told.append((done, total)),
    )
    assert told == [(k + 1, N) for k in range(N)] and report.pairs == () and report.deepest == 0


def test_what_cannot_be_checked_is_said_at_once() -> None:
    edit = scene({"a": at(0.0), "b": at(2.0)}, segment("late", 5, N + 1, "none"))
    with pytest.raises(ShapeError, match="segment late"):
        check(edit)
    short = replace(edit, segments=())
    captures = {"a": capture("a"), "b": capture("b", n=4)}
    with pytest.raises(MissingFrame, match="b: expected frame 14"):
        check_scene(short, captures, part_vertices=upper_half, parts_of_segment={})
