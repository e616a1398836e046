"""Third-party attitude filters, each with the defaults of its package: a stream of samples in, `enu_from_body` out (w, x, y, z).

A stream without a magnetometer is run as each package does it; the heading then counts from an arbitrary direction.
"""

from dataclasses import dataclass

import imufusion
import numpy as np
from ahrs.filters import EKF, Madgwick, Mahony
from vqf import VQF, offlineVQF

START_S = 0.5  # averaged for the attitude to start from, for filters that do not start themselves
STANDARD_GRAVITY = 9.80665


# ---------------------------------------------------------------- quaternions, w x y z, rows of arrays


def product(p, q):
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q):
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def between(q, following, share):
    """Attitudes at a share of the way from some to others, on the shortest arc."""
    step = product(conjugate(q), following)
    step = np.where(step[:, :1] < 0, -step, step)
    sine = np.linalg.norm(step[:, 1:], axis=1)
    half = np.arctan2(sine, step[:, 0])
    scale = np.where(sine > 0, np.sin(share * half) / np.where(sine > 0, sine, 1.0), 0.0)
    return product(q, np.column_stack([np.cos(share * half), step[:, 1:] * scale[:, None]]))


def interpolated(times, t, q):
    """Attitudes at `times` between attitudes `q` at `t`; not a number outside."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    part = between(q[k], q[k + 1], (times - t[k]) / (t[k + 1] - t[k]))
    inside = (times >= t[0]) & (times <= t[-1])
    return np.where(inside[:, None], part, np.nan)


def from_vectors(up, field):
    """`enu_from_body` from specific force at rest and magnetic field, in body axes."""
    up = up / np.linalg.norm(up)
    east = np.cross(field, up)
    east = east / np.linalg.norm(east)
    matrix = np.stack([east, np.cross(up, east), up])
    # The eigenvector of the largest eigenvalue of this matrix is the quaternion (Bar-Itzhack 2000).
    d = matrix
    k = np.array(
        [
            [d[0, 0] + d[1, 1] + d[2, 2], d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]],
            [d[2, 1] - d[1, 2], d[0, 0] - d[1, 1] - d[2, 2], d[0, 1] + d[1, 0], d[0, 2] + d[2, 0]],
            [d[0, 2] - d[2, 0], d[0, 1] + d[1, 0], d[1, 1] - d[0, 0] - d[2, 2], d[1, 2] + d[2, 1]],
            [d[1, 0] - d[0, 1], d[0, 2] + d[2, 0], d[1, 2] + d[2, 1], d[2, 2] - d[0, 0] - d[1, 1]],
        ]
    )
    return np.linalg.eigh(k)[1][:, -1]


# ---------------------------------------------------------------- what they are given


@dataclass
class Recording:
    """One stream of samples at one rate."""

    t: np.ndarray  # s
    rate_hz: float
    gyro: np.ndarray  # rad/s
    acc: np.ndarray  # m/s^2
    mag: np.ndarray | None  # uT

    @property
    def start(self):
        """The attitude to start from, by the means of the first moments; without a field it looks anywhere."""
        n = max(1, int(START_S * self.rate_hz))
        up = self.acc[:n].mean(0)
        if self.mag is not None:
            return from_vectors(up, self.mag[:n].mean(0))
        return from_vectors(up, np.eye(3)[np.argmin(np.abs(up))])

    @property
    def dip_deg(self):
        """Of the field in the first moments."""
        n = max(1, int(START_S * self.rate_hz))
        up, field = self.acc[:n].mean(0), self.mag[:n].mean(0)
        down = -field @ (up / np.linalg.norm(up))
        return float(np.degrees(np.arctan2(down, np.sqrt(field @ field - down**2))))


# ---------------------------------------------------------------- filters: Recording -> enu_from_body


def vqf(recording):
    filter_, samples = VQF(1 / recording.rate_hz), (recording.gyro, recording.acc)
    if recording.mag is None:
        return filter_.updateBatch(*samples)["quat6D"]
    return filter_.updateBatch(*samples, recording.mag)["quat9D"]


def vqf_offline(recording):
    """Looks at the whole recording, forwards and backwards: compare with smoothers."""
    found = offlineVQF(recording.gyro, recording.acc, recording.mag, 1 / recording.rate_hz)
    return found["quat6D" if recording.mag is None else "quat9D"]


def fusion(recording, **more):
    settings = imufusion.AhrsSettings(sample_rate=recording.rate_hz, gain=0.5, **more)
    settings.convention = imufusion.CONVENTION_ENU  # 1.3.3 ignores it in the constructor
    ahrs = imufusion.Ahrs()
    ahrs.set_settings(settings)
    bias = None
    if more:
        bias = imufusion.Bias()
        bias.set_settings(imufusion.BiasSettings(sample_rate=recording.rate_hz))
    estimates = np.empty((len(recording.t), 4))
    gyro_deg_s, acc_g = np.degrees(recording.gyro), recording.acc / STANDARD_GRAVITY
    for k, (g, a) in enumerate(zip(gyro_deg_s, acc_g)):
        g = bias.update(g) if bias else g
        if recording.mag is None:
            ahrs.update_no_magnetometer(g, a)
        else:
            ahrs.update(g, a, recording.mag[k])
        estimates[k] = ahrs.get_quaternion()
    return estimates


def fusion_advanced(recording):
    """The settings of the project's own advanced example."""
    limits = {"acceleration_rejection": 10, "magnetic_rejection": 10, "rejection_timeout": 5}
    return fusion(recording, gyroscope_range=2000, **limits)


def stepped(step, start, recording):
    """A function of the last attitude and one sample of each sensor, over all samples."""
    estimates = np.empty((len(recording.t), 4))
    estimates[0] = q = start
    sensors = [recording.gyro, recording.acc] + ([] if recording.mag is None else [recording.mag])
    for k, samples in enumerate(zip(*(sensor[1:] for sensor in sensors)), start=1):
        estimates[k] = q = step(q, *samples)
    return estimates


def madgwick(recording):
    """Its world is north, west, up: a quarter turn from ours. Gains are its defaults with and without a magnetometer."""
    quarter = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    own = Madgwick(frequency=recording.rate_hz, gain=0.033 if recording.mag is None else 0.041)
    step = own.updateIMU if recording.mag is None else own.updateMARG
    return product(quarter, stepped(step, product(conjugate(quarter), recording.start), recording))


def mahony(recording):
    own = Mahony(frequency=recording.rate_hz)
    return stepped(own.updateIMU if recording.mag is None else own.updateMARG, recording.start, recording)


def ekf(recording):
    """With the dip of the field at the start, and -1 g on the up axis as its ENU world wants it."""
    field = {} if recording.mag is None else {"magnetic_ref": recording.dip_deg, "mag": np.ones((1, 3))}
    own = EKF(frequency=recording.rate_hz, frame="ENU", **field)
    step = lambda q, g, a, *m: own.update(q, g, -a, *m)
    return stepped(step, recording.start, recording)


FILTERS = {
    "vqf": vqf,
    "vqf-offline": vqf_offline,
    "fusion": fusion,
    "fusion-advanced": fusion_advanced,
    "ahrs-madgwick": madgwick,
    "ahrs-mahony": mahony,
    "ahrs-ekf": ekf,
}
