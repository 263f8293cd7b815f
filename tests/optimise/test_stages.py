import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.optimise.stages import NoSolution, pose_codes, stages_of
from tests.optimise.problems import STEP, segment_of

keys = st.lists(
    st.tuples(st.integers(-3000, 3000), st.integers(-3000, 3000), st.integers(0, 719)),
    min_size=1, max_size=20, unique=True,
)  # fmt: skip
few_keys = st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1), st.integers(0, 1)), max_size=12, unique=True)


@given(keys)
def test_codes_tell_poses_apart_and_keep_their_order(poses: list[tuple[int, int, int]]) -> None:
    codes = pose_codes(np.array(poses))
    assert [poses[i] for i in np.argsort(codes)] == sorted(poses)
    assert len(np.unique(codes)) == len(codes)


def test_segments_that_do_not_adjoin_keep_their_own_solutions() -> None:
    segments = [segment_of("one", [(0, 0, 0)], root_a=(1, 2)), segment_of("two", [(1, 0, 0), (5, 0, 0)])]
    one, two = stages_of(segments, [False])
    assert one.names == ("one",) and two.names == ("two",)
    assert (len(one), len(two)) == (1, 2)
    assert one.roots_a.tolist() == [[1, 2]] and one.roots_b.shape == (1, 2)


@settings(max_examples=40)
@given(st.lists(few_keys, min_size=2, max_size=3))
def test_adjoining_segments_share_what_all_of_them_accept(groups: list[list[tuple[int, int, int]]]) -> None:
    merits = [[0.1 * (7 * k[0] + 3 * k[1] + k[2]) * (-1) ** i for k in group] for i, group in enumerate(groups)]
    segments = [segment_of(str(i), g, merit=m) for i, (g, m) in enumerate(zip(groups, merits, strict=True))]
    common = sorted(set.intersection(*(set(group) for group in groups)))
    if not common:
        with pytest.raises(NoSolution):
            stages_of(segments, [True] * (len(groups) - 1))
        return
    (stage,) = stages_of(segments, [True] * (len(groups) - 1))
    assert [tuple(key) for key in stage.keys.tolist()] == common
    assert stage.poses[:, :2] == pytest.approx(STEP * stage.keys[:, :2])
    least = [min(m[g.index(key)] for g, m in zip(groups, merits, strict=True)) for key in common]
    assert stage.merit == pytest.approx(np.array(least))


def test_adjoining_segments_with_nothing_in_common_are_named() -> None:
    segments = [segment_of(n, [k]) for n, k in (("hug", (0, 0, 0)), ("shake", (0, 0, 1)), ("bow", (0, 0, 0)))]
    with pytest.raises(NoSolution, match='"hug" and "shake" adjoin') as caught:
        stages_of(segments, [True, False])
    assert caught.value.segments == ("hug", "shake")


def test_a_segment_without_solutions_is_named() -> None:
    with pytest.raises(NoSolution, match='"two" has no solution'):
        stages_of([segment_of("one", [(0, 0, 0)]), segment_of("two", [])], [False])
