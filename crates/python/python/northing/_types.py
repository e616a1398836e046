"""Types of arrays that the module's signatures share."""

from __future__ import annotations

from typing import Any, TypedDict, Union

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
# What numpy makes an array of: lists, arrays of any number type and stride, DataFrames.
ArrayLike = Union[npt.ArrayLike, Any]


class Innovations(TypedDict):
    """Innovations of one sensor, a row a measurement; NaN where the estimator states nothing."""

    time_ns: Integers
    residual: Floats
    covariance: Floats
    nis: Floats
    degrees_of_freedom: npt.NDArray[np.uint8]
    # 0 fused, 1 inflated, 2 gated, 3 skipped
    outcome: npt.NDArray[np.uint8]
