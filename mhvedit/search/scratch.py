"""Memory that short-lived arrays are laid into again and again: clearing fresh pages would take as long as the work."""

from math import prod
from typing import Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

LINE: Final = 64  # bytes of a line of the processor's cache; arrays begin on one


class Scratch:
    """Arrays by name; one that is asked for again lies where the last one lay. For one thread."""

    def __init__(self) -> None:
        self._memory: dict[str, NDArray[np.uint8]] = {}
        self._last: dict[str, NDArray[Any]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """An array with no defined contents; the last one of that name loses its own."""
        last = self._last.get(name)
        if last is not None and last.shape == shape and last.dtype == dtype:
            return last
        size = prod(shape) * np.dtype(dtype).itemsize
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = _aligned(size)
        last = self._last[name] = memory[:size].view(dtype).reshape(shape)
        return last


def _aligned(size: int) -> NDArray[np.uint8]:
    """Bytes from the beginning of a cache line on."""
    whole = np.empty(size + LINE, np.uint8)
    first = -whole.ctypes.data % LINE
    return whole[first : first + size]
