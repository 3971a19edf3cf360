"""The kinds of arrays that the whole package works with; their shapes stand in the docstrings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
MaskArray = NDArray[np.bool_]
