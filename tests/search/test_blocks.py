"""Blocks of shifts against looking at every shift."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.search.blocks import mark_blocks, most_blocks
from mhvedit.search.pyramid import TOP


@given(seed=st.integers(0, 2**32 - 1), stride=st.integers(1, 3), share=st.sampled_from([0.0, 0.02, 0.5]))
def test_a_block_is_marked_if_a_shift_in_it_is_asked_for(seed: int, stride: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    asked = rng.random(rng.integers(1, 40, 2)) < share
    base = rng.integers(-50, 50, 2)
    blocks = np.empty(most_blocks(*asked.shape, stride), np.bool_)
    first, size = mark_blocks(asked, *base, stride, blocks)
    shifts = base + np.argwhere(asked) * stride
    for level in range(1, TOP + 1):
        n_x, n_y = size[level].tolist()
        found = np.argwhere(blocks[first[level] : first[level] + n_x * n_y].reshape(n_x, n_y)) + (base >> level)
        assert {tuple(block) for block in found.tolist()} == {tuple(block) for block in (shifts >> level).tolist()}
        assert (((base + (np.array(asked.shape) - 1) * stride) >> level) - (base >> level) + 1).tolist() == [n_x, n_y]
