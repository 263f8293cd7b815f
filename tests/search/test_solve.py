"""The search against brute force (`tests/oracles.py`), pose for pose and reason for reason."""

from collections import Counter
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import InteractionType, Slack, temporal_clauses
from mhvedit.constraints.fidelity import fidelity_clauses
from mhvedit.constraints.visibility import SightCone
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.sight import MutualSight
from mhvedit.search.solve import ReasonMap, SightTest, search_poses
from mhvedit.sequences.meshes import BODY
from tests import oracles
from tests.oracles import Cone, Segment
from tests.search.shapes import HAND, PARTS, PITCH, SWORD, Made, made, random_subject

Pose = tuple[int, int, int]  # voxels, voxels, yaw sample
FEW = settings(max_examples=6, derandomize=True)
SEEDS = st.integers(0, 2**32 - 1)
Pair = tuple[Made, Made]


def random_pair(rng: np.random.Generator, tau: int) -> Pair:
    return random_subject(rng, tau), random_subject(rng, tau)


def random_cone(rng: np.random.Generator) -> Cone:
    eye, way = rng.normal(0, 4 * PITCH, 3), rng.normal(size=3)
    way /= np.linalg.norm(way)
    return (eye[0], eye[1], eye[2]), (way[0], way[1], way[2]), float(rng.uniform(0.2, 1.9))


def clauses_of(pair: Pair, s: Segment) -> tuple[Clause, ...]:
    a, b = pair[0].volumes, pair[1].volumes
    kind = InteractionType(s.interaction)
    touch = a.parts[s.parts[0]].volume, b.parts[s.parts[1]].volume
    return temporal_clauses(kind, *touch, slack=Slack(s.frames, s.voxels)) + fidelity_clauses(
        kind, a, b, parts=s.parts, apart=s.apart, depth=s.depth * PITCH, overlap=s.overlap * PITCH, pitch=PITCH
    )


def sight_of(pair: Pair, s: Segment) -> SightTest | None:
    if s.cones is None:
        return None
    a, b = (SightCone(np.array(eye), np.array(way), angle) for eye, way, angle in s.cones)
    return SightTest(MutualSight(a, b), pair[0].volumes.body, pair[1].volumes.body)


def search(
    pair: Pair, s: Segment, *, stride: int = 1, n_yaw: int = 8, window: float = 11, workers: int = 1
) -> ReasonMap:
    """The search as the pipeline calls it; the window in voxels."""
    grid = pose_grid(
        pair[0].root, pair[1].root, pitch=PITCH, stride=stride, n_yaw=n_yaw, window=window * PITCH
    )  # fmt: skip
    return search_poses(grid, clauses_of(pair, s), sight=sight_of(pair, s), workers=workers)


def told(found: ReasonMap) -> dict[Pose, str]:
    """Reason of each pose in the window."""
    grid = found.grid
    names = np.array(found.reasons)[found.reason]
    inside = [c for c in np.ndindex(found.reason.shape) if names[c] != "outside the window"]
    return {lattice_pose(grid, c): str(names[c]) for c in inside}


def lattice_pose(grid: PoseGrid, cell: tuple[int, ...]) -> Pose:
    x, y = (grid.base[cell[2]] + cell[:2]) * grid.stride
    return int(x), int(y), cell[2]


def brute_force(pair: Pair, s: Segment, *, stride: int = 1, n_yaw: int = 8, window: float = 11) -> dict[Pose, str]:
    expected: dict[Pose, str] = {}
    for k in range(n_yaw):
        yaw = k * (2 * np.pi / n_yaw)
        steps = oracles.window_shifts(
            pair[0].root, pair[1].root, yaw, pitch=PITCH, stride=stride, window=window * PITCH
        )  # fmt: skip
        at_yaw = oracles.reasons(s, yaw, [(x * stride, y * stride) for x, y in steps])
        expected |= {(x, y, k): reason for (x, y), reason in at_yaw.items()}
    return expected


def segment(pair: Pair, kind: InteractionType, **asked: object) -> Segment:
    tau = pair[0].volumes.body.n_frames
    plain = Segment(pair[0].person, pair[1].person, kind.value, (HAND, HAND), tau, pitch=PITCH)
    return replace(plain, **asked)  # type: ignore[arg-type]


def random_demands(rng: np.random.Generator, kind: InteractionType) -> dict[str, object]:
    """Parts, tolerances, lists of what keeps apart, cones: each there or not."""
    pairs = list(product(PARTS, PARTS))
    lists = [None, [], [(BODY, BODY)], [pairs[i] for i in rng.integers(0, len(pairs), 2)]]
    return {
        "parts": pairs[int(rng.integers(len(pairs)))],
        "frames": int(rng.choice([0, 0, 1, 2])),
        "voxels": float(rng.choice([0, 0, 1, 1.5, 2])),
        "depth": float(rng.choice([0, 0.4, 0.5, 1, 1.5])),
        "overlap": float(rng.choice([0, 0.3, 0.5, 0.9, 1.5])),
        "apart": lists[int(rng.choice([0, 0, 1, 2, 3]))],
        "cones": (random_cone(rng), random_cone(rng)) if rng.random() < 0.4 else None,
    }


@pytest.mark.parametrize("kind", InteractionType)
@given(seed=SEEDS, tau=st.integers(1, 6), stride=st.sampled_from([1, 2]), n_yaw=st.sampled_from([8, 9, 12]))
@FEW
def test_the_search_agrees_with_brute_force_pose_for_pose(
    kind: InteractionType, seed: int, tau: int, stride: int, n_yaw: int
) -> None:
    rng = np.random.default_rng(seed)
    pair = random_pair(rng, tau)
    s = segment(pair, kind, **random_demands(rng, kind))
    found = told(search(pair, s, stride=stride, n_yaw=n_yaw))
    assert found == brute_force(pair, s, stride=stride, n_yaw=n_yaw)


@pytest.mark.parametrize("kind", InteractionType)
@given(seed=SEEDS, tau=st.sampled_from([64, 65, 70]))
@settings(FEW, max_examples=2)
def test_the_search_agrees_with_brute_force_beyond_one_word_of_frames(
    kind: InteractionType, seed: int, tau: int
) -> None:
    rng = np.random.default_rng(seed)
    pair = random_pair(rng, tau)
    s = segment(pair, kind, **random_demands(rng, kind) | {"frames": int(rng.choice([0, 3, 30]))})
    assert told(search(pair, s, window=7)) == brute_force(pair, s, window=7)


@pytest.mark.parametrize("kind", InteractionType)
def test_every_type_accepts_some_poses_and_rejects_others_without_any_slack(kind: InteractionType) -> None:
    counts: Counter[str] = Counter()
    seeds = iter(range(40))
    while counts["accepted"] == 0 or counts.total() == counts["accepted"]:
        pair = random_pair(np.random.default_rng(next(seeds)), 2)
        s = segment(pair, kind, parts=(SWORD, HAND), overlap=0.5, depth=1.0)
        found = told(search(pair, s, n_yaw=4, window=15))
        assert found == brute_force(pair, s, n_yaw=4, window=15)
        counts.update(found.values())
    assert kind is InteractionType.NONE or counts["no contact"] > 0


@given(seed=SEEDS)
@settings(FEW, max_examples=15)
def test_loosening_a_tolerance_never_loses_a_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pair, kind = random_pair(rng, 4), list(InteractionType)[int(rng.integers(12))]
    s = segment(pair, kind, **random_demands(rng, kind))
    name, more = [("frames", 1), ("voxels", 1.0), ("depth", 0.6), ("overlap", 1.0)][int(rng.integers(4))]
    loose = replace(s, **{name: getattr(s, name) + more})
    assert accepted(search(pair, s)) <= accepted(search(pair, loose))


@given(seed=SEEDS, stride=st.sampled_from([1, 2]), kind=st.sampled_from(InteractionType))
@settings(FEW, max_examples=15)
def test_swapping_a_and_b_inverts_the_poses_of_the_mirrored_type(seed: int, stride: int, kind: InteractionType) -> None:
    rng = np.random.default_rng(seed)
    pair = random_pair(rng, 4)
    s = segment(pair, kind, **random_demands(rng, kind))
    cones = s.cones and (s.cones[1], s.cones[0])
    apart = None if s.apart is None else [(b, a) for a, b in s.apart]
    swapped = replace(
        s, a=s.b, b=s.a, interaction=kind.mirrored.value, parts=(s.parts[1], s.parts[0]), apart=apart, cones=cones
    )  # fmt: skip
    there = accepted(search(pair, s, stride=stride, n_yaw=4))
    back = accepted(search((pair[1], pair[0]), swapped, stride=stride, n_yaw=4))
    assert {inverse_quarter_turn(pose) for pose in there} == back


@given(seed=SEEDS, n_yaw=st.sampled_from([4, 5, 6]), kind=st.sampled_from(InteractionType))
@settings(FEW, max_examples=15)
def test_halving_the_steps_keeps_every_pose_that_the_coarser_search_found(
    seed: int, n_yaw: int, kind: InteractionType
) -> None:
    rng = np.random.default_rng(seed)
    pair = random_pair(rng, 4)
    s = segment(pair, kind, **random_demands(rng, kind))
    coarse = told(search(pair, s, stride=2, n_yaw=n_yaw))
    fine = told(search(pair, s, stride=1, n_yaw=2 * n_yaw))
    assert coarse == {(x, y, k): fine[x, y, 2 * k] for x, y, k in coarse}


def test_the_number_of_workers_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    pair = random_pair(rng, 5)
    s = segment(pair, InteractionType.SOMETIMES, voxels=1.0, cones=(random_cone(rng), random_cone(rng)))
    one, four = search(pair, s), search(pair, s, workers=4)
    np.testing.assert_array_equal(one.reason, four.reason)
    assert one.reasons == four.reasons


def test_progress_ends_at_one_and_never_falls() -> None:
    pair = random_pair(np.random.default_rng(0), 2)
    grid = pose_grid(pair[0].root, pair[1].root, pitch=PITCH, stride=1, n_yaw=30, window=0.1)
    shares: list[float] = []
    search_poses(grid, clauses_of(pair, segment(pair, InteractionType.NONE)), progress=shares.append)
    assert shares == sorted(shares) and len(shares) > 1 and shares[-1] == 1


def test_reasons_are_named_in_the_order_in_which_they_are_blamed() -> None:
    rng = np.random.default_rng(1)
    pair = random_pair(rng, 3)
    s = segment(pair, InteractionType.END_END, parts=(BODY, BODY), cones=(random_cone(rng), random_cone(rng)))
    found = search(pair, s)
    assert found.reasons == (
        "accepted",
        "outside the window",
        "no contact",
        "no contact at the right moment",
        "contact at a wrong moment",
        "contact sinks in too deep",
        "bodies meet",
        "B is out of A's sight",
        "A is out of B's sight",
    )
    assert sum(found.counts().values()) == found.reason.size
    assert found.counts()["accepted"] == found.accepted.sum() == len(accepted(found))


@pytest.mark.parametrize("kind", InteractionType)
def test_an_empty_part_is_never_in_contact(kind: InteractionType) -> None:
    full = random_subject(np.random.default_rng(5), 3)
    bodies = list(full.person.solids[BODY])
    handless = made({BODY: bodies}, {BODY: (BODY, bodies), HAND: (BODY, [frozenset()] * 3)})
    for pair in ((full, handless), (handless, full), (handless, handless)):
        s = segment(pair, kind, voxels=1.0)
        found = told(search(pair, s, n_yaw=4, window=7))
        assert found == brute_force(pair, s, n_yaw=4, window=7)
        assert kind is InteractionType.NONE or set(found.values()) == {"no contact"}


@pytest.mark.parametrize("kind", InteractionType)
def test_an_empty_subject_meets_nobody(kind: InteractionType) -> None:
    nothing: list[frozenset[oracles.Voxel]] = [frozenset()] * 2
    ghost = made({BODY: nothing}, {BODY: (BODY, nothing), HAND: (BODY, nothing)})
    full = random_subject(np.random.default_rng(6), 2)
    cone: Cone = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 3.0)
    for pair, cones in product(((full, ghost), (ghost, full), (ghost, ghost)), (None, (cone, cone))):
        s = segment(pair, kind, cones=cones)
        assert told(search(pair, s, n_yaw=4, window=5)) == brute_force(pair, s, n_yaw=4, window=5)


@pytest.mark.parametrize("kind", InteractionType)
def test_two_single_voxels(kind: InteractionType) -> None:
    dots = [frozenset({(3, -2, 1)})], [frozenset({(-4, 0, 1)})]
    pair = tuple(made({BODY: dot}, {BODY: (BODY, dot), HAND: (BODY, dot)}) for dot in dots)
    s = segment((pair[0], pair[1]), kind)
    found = told(search((pair[0], pair[1]), s, window=5))
    assert found == brute_force((pair[0], pair[1]), s, window=5)
    together = kind not in (InteractionType.PASSING, InteractionType.NONE)
    n_accepted = sum(reason == "accepted" for reason in found.values())
    assert n_accepted == (8 if together else 0 if kind is InteractionType.PASSING else len(found) - 8)


@pytest.mark.parametrize("window", [0.0, 0.9, 1.0, 2.0])
def test_a_window_smaller_than_the_bodies_holds_the_few_poses_in_it(window: float) -> None:
    pair = random_pair(np.random.default_rng(8), 3)
    s = segment(pair, InteractionType.SOMETIMES)
    found = told(search(pair, s, window=window))
    assert found == brute_force(pair, s, window=window)
    assert len(found) <= 8 * 9


def accepted(found: ReasonMap) -> set[Pose]:
    return {pose for pose, reason in told(found).items() if reason == "accepted"}


def inverse_quarter_turn(pose: Pose) -> Pose:
    """A beside B, where B beside A is given; yaw in quarter turns, so that lattices fall on each other."""
    x, y, k = pose
    for _ in range(4 - k):
        x, y = -y, x
    return -x, -y, -k % 4
