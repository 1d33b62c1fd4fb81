"""Types of arrays by what their numbers are; shapes and units are in comments above them."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

RealArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
# real where the body or the wave is
RealOrComplex: TypeAlias = NDArray[np.float64] | NDArray[np.complex128]
# numbers of nodes, cells, rows
IntegerArray: TypeAlias = NDArray[np.integer[Any]]
BooleanArray: TypeAlias = NDArray[np.bool_]
