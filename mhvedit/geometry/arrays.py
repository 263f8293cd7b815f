"""Names for the arrays that functions pass around."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
Words = NDArray[np.uint64]
ByteArray = NDArray[np.uint8]
