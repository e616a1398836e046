"""The names of the package ``vqf``, with the bounded-velocity filter behind them: one import line changes.

What VQF finds and this filter does not (rests, disturbances of the field) is not in the answers; rows before the filter is
aligned are NaN. Parameters are those of :func:`northing.attitude`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ._asked import Parameter
from ._attitude import attitude
from ._results import Attitude
from ._types import ArrayLike, Floats


class VQF:
    """Attitude from gyroscope (rad/s), accelerometer (m/s^2) and magnetometer, whole recordings at a time."""

    def __init__(
        self,
        gyrTs: float,
        accTs: float = -1.0,
        magTs: float = -1.0,
        **parameters: Parameter,
    ) -> None:
        if not gyrTs > 0.0:
            raise ValueError(f"gyrTs={gyrTs!r}: expected the sampling time in seconds, above 0, e.g. 0.01")
        self._times = {"gyr": gyrTs, "acc": accTs if accTs > 0 else gyrTs, "mag": magTs if magTs > 0 else gyrTs}
        self._parameters = parameters

    def _run(self, gyr: ArrayLike, acc: ArrayLike, mag: ArrayLike | None) -> Attitude:
        stamps = {}
        for name, values in (("acc", acc), ("mag", mag)):
            # As many rows at the same rate are samples of the same instants.
            if values is not None and self._times[name] != self._times["gyr"]:
                stamps[f"{name}_t"] = np.arange(len(np.asarray(values))) * self._times[name]
        parameters: dict[str, Any] = {**stamps, **self._parameters}
        return attitude(gyr, acc, mag, t=np.arange(len(np.asarray(gyr))) * self._times["gyr"], **parameters)

    def updateBatch(self, gyr: ArrayLike, acc: ArrayLike, mag: ArrayLike | None = None) -> dict[str, Floats]:
        """``quat6D`` without and ``quat9D`` with the magnetometer, w, x, y, z, body to east-north-up; ``bias`` (rad/s) and its
        standard deviation ``biasSigma``; beyond VQF ``covariance`` (rad^2, local error, body axes) of the best of them.
        """
        without = self._run(gyr, acc, None)
        best = without if mag is None else self._run(gyr, acc, mag)
        answer = {"quat6D": without.quat}
        if mag is not None:
            answer["quat9D"] = best.quat
        variances = np.diagonal(best.gyro_bias_covariance, axis1=1, axis2=2)
        answer["bias"] = best.gyro_bias
        answer["biasSigma"] = np.sqrt(np.maximum(variances.max(axis=1), 0.0))
        answer["covariance"] = best.covariance
        return answer
