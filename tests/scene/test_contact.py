"""The verdict of every type on two balls that move as they should, and as they should not."""

from collections.abc import Sequence

import numpy as np
import pytest
import trimesh

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.geometry.arrays import FloatArray
from mhvedit.scene.contact import (
    MOMENTS,
    RULES,
    ContactSlack,
    PartSeries,
    cut_part,
    judge_contact,
    spans,
)
from mhvedit.scene.surfaces import clearance, open_surface
from mhvedit.sequences.meshes import Mesh

RADIUS = 0.05
BALL = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
N = 9
FAR = 9.0


def mesh(x: float) -> Mesh | None:
    return None if x == FAR else Mesh(BALL.vertices + np.array([x, 0.0, 1.0]), BALL.faces.astype(np.int32))


def series(a: Sequence[float] | FloatArray, b: Sequence[float] | FloatArray) -> PartSeries:
    """Balls of which A is at x = a[i] and B at x = b[i]; a position of FAR is an empty part."""
    meshes_a, meshes_b = tuple(mesh(x) for x in a), tuple(mesh(x) for x in b)
    gaps, places = [], []
    for one, other in zip(meshes_a, meshes_b, strict=True):
        if one is None or other is None:
            gaps.append(np.inf)
            places.append(np.full(3, np.nan))
            continue
        found = clearance(open_surface(one), open_surface(other), reach=0.25)
        gaps.append(found.gap)
        places.append(found.point)
    return PartSeries(100, np.array(gaps), np.array(places), meshes_a, meshes_b)


def line(start: float, end: float) -> FloatArray:
    return np.linspace(start, end, N)


TOWARDS, MEETING = line(-0.6, -0.045), line(0.6, 0.045)  # they meet at 0 in the last frame, 10 mm deep
STILL_AT_0, STILL_AT_9CM = np.full(N, 0.0), np.full(N, 0.09)
THERE_AND_BACK = np.concatenate([line(-0.6, 0.0)[::2], line(0.0, -0.6)[::2][1:]])
GOOD = {
    "+&+": (TOWARDS, MEETING),
    "-&-": (TOWARDS[::-1], MEETING[::-1]),
    "+&-": (line(-0.6, 0.0), line(0.09, 0.9)),  # A arrives where B stood
    "-&+": (line(0.09, 0.9), line(-0.6, 0.0)),
    "+&0": (line(-0.6, 0.0), THERE_AND_BACK[::-1] * -1 + 0.09),
    "0&+": (THERE_AND_BACK[::-1] * -1 + 0.09, line(-0.6, 0.0)),
    "-&0": (line(0.0, -0.6), np.concatenate([[0.09] * 3, line(0.09, 0.6)[3:]])),
    "0&-": (np.concatenate([[0.09] * 3, line(0.09, 0.6)[3:]]), line(0.0, -0.6)),
    "0&0a": (line(0, 0.5), line(0.09, 0.59)),
    "0&0b": (THERE_AND_BACK, STILL_AT_9CM),
    "0&0c": (line(-0.6, 0.6), np.concatenate([[FAR] * 7, [0.0, 0.0]])),
    "none": (STILL_AT_0, STILL_AT_0 + 0.12),
}
BAD = {
    "+&+": (TOWARDS[::-1], MEETING[::-1]),
    "-&-": (TOWARDS, MEETING),
    "+&-": (line(-0.6, -0.2), line(0.09, 0.9)),
    "-&+": (line(0.09, 0.9), line(-0.6, -0.2)),
    "+&0": (THERE_AND_BACK, STILL_AT_9CM),  # touches in the middle and leaves
    "0&+": (STILL_AT_9CM, THERE_AND_BACK),
    "-&0": (THERE_AND_BACK, STILL_AT_9CM),
    "0&-": (STILL_AT_9CM, THERE_AND_BACK),
    "0&0a": (THERE_AND_BACK, STILL_AT_9CM),
    "0&0b": (STILL_AT_0, STILL_AT_0 + 0.2),
    "0&0c": (line(-0.6, 0.6), STILL_AT_0),
    "none": (THERE_AND_BACK, STILL_AT_9CM),
}


def test_every_type_has_a_rule() -> None:
    assert set(MOMENTS) | set(RULES) == set(InteractionType)
    assert not set(MOMENTS) & set(RULES)


@pytest.mark.parametrize("interaction", list(InteractionType))
def test_a_type_holds_where_it_should(interaction: InteractionType) -> None:
    verdict = judge_contact(interaction, series(*GOOD[interaction.value]), slack=ContactSlack())
    assert verdict.agrees, verdict.sentence
    assert verdict.sentence.startswith(f"{interaction.value} holds: ")


@pytest.mark.parametrize("interaction", list(InteractionType))
def test_a_type_does_not_hold_where_it_should_not(interaction: InteractionType) -> None:
    verdict = judge_contact(interaction, series(*BAD[interaction.value]), slack=ContactSlack())
    assert not verdict.agrees, verdict.sentence
    assert verdict.sentence.startswith(f"{interaction.value} does not hold: ")


def test_contact_that_comes_early_but_stays_is_still_an_end() -> None:
    a = np.concatenate([line(-0.6, -0.045)[::2], np.full(4, -0.045)])
    verdict = judge_contact(InteractionType.END_END, series(a, -a), slack=ContactSlack())
    assert verdict.agrees and "104-108" in verdict.sentence


def test_slack_in_time_excuses_the_last_frames() -> None:
    a = np.concatenate([line(-0.6, -0.045)[1:], [-0.5]])
    parts = series(a, -a)
    assert not judge_contact(InteractionType.END_END, parts, slack=ContactSlack()).agrees
    assert judge_contact(InteractionType.END_END, parts, slack=ContactSlack(frames=1)).agrees


def test_slack_in_space_excuses_a_miss() -> None:
    parts = series(line(-0.6, 0.0), STILL_AT_0 + 0.115)
    assert not judge_contact(InteractionType.END_LATERAL, parts, slack=ContactSlack()).agrees
    assert judge_contact(InteractionType.END_LATERAL, parts, slack=ContactSlack(near=0.02)).agrees


def test_overlap_that_is_allowed_is_no_contact() -> None:
    parts = series(STILL_AT_0, STILL_AT_9CM)
    assert not judge_contact(InteractionType.NONE, parts, slack=ContactSlack()).agrees
    assert judge_contact(InteractionType.NONE, parts, slack=ContactSlack(overlap=0.02)).agrees


def test_a_hold_may_miss_its_ends_within_slack_but_never_all_of_it() -> None:
    parts = series([-0.2, 0, 0], [0.09, 0.09, 0.4])
    assert not judge_contact(InteractionType.THROUGHOUT, parts, slack=ContactSlack()).agrees
    assert judge_contact(InteractionType.THROUGHOUT, parts, slack=ContactSlack(frames=1)).agrees
    apart = series([-0.2, -0.2, -0.2], [0.09, 0.09, 0.4])
    assert not judge_contact(InteractionType.THROUGHOUT, apart, slack=ContactSlack(frames=9)).agrees


def test_who_passes_later_is_told() -> None:
    a, b = GOOD["0&0c"]
    assert (
        "B passes where A has been"
        in judge_contact(InteractionType.PASSING, series(a, b), slack=ContactSlack()).sentence
    )
    assert (
        "A passes where B has been"
        in judge_contact(InteractionType.PASSING, series(b, a), slack=ContactSlack()).sentence
    )


def test_an_empty_part_never_meets() -> None:
    parts = series([FAR] * N, list(STILL_AT_0))
    for interaction in InteractionType:
        verdict = judge_contact(interaction, parts, slack=ContactSlack(frames=2))
        assert verdict.agrees == (interaction is InteractionType.NONE), verdict.sentence


def test_spans() -> None:
    assert spans([5, 3, 4, 9]) == "3-5, 9" and spans([]) == "none"


def test_a_part_is_cut_with_all_faces_that_it_reaches() -> None:
    whole = Mesh(np.asarray(BALL.vertices, np.float64), BALL.faces.astype(np.int32))
    upper = cut_part(whole, whole.vertices[:, 2] > 0)
    assert upper is not None and len(whole.faces) / 2 <= len(upper.faces) < len(whole.faces)
    assert upper.faces.max() == len(upper.vertices) - 1
    assert cut_part(whole, np.zeros(len(whole.vertices), np.bool_)) is None
