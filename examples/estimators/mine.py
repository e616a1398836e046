"""An attitude estimator of one's own: a multiplicative extended Kalman filter in sixty lines, to change and to compare.

    northing compare walk.csv --estimators mekf,examples/estimators/mine.py:Mine
    northing live --estimator examples/estimators/mine.py:Mine

The error is the local one: q_true = q * exp(a), with a in body axes. States: a (rad) and the gyroscope bias b (rad/s).
"""

import numpy as np

import northing as no

GYROSCOPE_NOISE_DENSITY = 3e-3  # (rad/s)/sqrt(Hz)
BIAS_RANDOM_WALK = 1e-5  # (rad/s)/sqrt(s)
ACCELEROMETER_STD = 0.5  # m/s^2: what a hand does to a phone, not what its sensor does
MAGNETOMETER_STD = 2.0  # microtesla


def cross(v):
    """The matrix of a cross product: cross(v) @ u is v x u."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def times(p, q):
    """The product of two quaternions, w, x, y, z."""
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def exp(v):
    """The quaternion that turns by a rotation vector, rad."""
    half = np.linalg.norm(v) / 2.0
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) * np.asarray(v) / 2.0])


def matrix(q):
    """The rotation matrix of a quaternion."""
    v = cross(q[1:])
    return np.eye(3) + 2.0 * q[0] * v + 2.0 * v @ v


class Mine(no.Estimator):
    """A multiplicative extended Kalman filter with gyroscope bias."""

    def start(self, quat, covariance, gyro_bias, gyro_bias_std, force, field):
        self.quat, self.gyro_bias = np.array(quat), np.array(gyro_bias)
        self.force, self.field = np.array(force), None if field is None else np.array(field)
        self.P = np.zeros((6, 6))
        self.P[:3, :3], self.P[3:, 3:] = covariance, np.eye(3) * gyro_bias_std**2

    def gyroscope(self, rate, dt):
        turn = (np.array(rate) - self.gyro_bias) * dt
        self.quat = times(self.quat, exp(turn))
        F = np.eye(6)
        F[:3, :3], F[:3, 3:] = matrix(exp(turn)).T, -np.eye(3) * dt
        Q = np.repeat([GYROSCOPE_NOISE_DENSITY**2 * dt, BIAS_RANDOM_WALK**2 * dt], 3)
        self.P = F @ self.P @ F.T + np.diag(Q)

    def accelerometer(self, force):
        return self.update(np.array(force), self.force, ACCELEROMETER_STD)

    def magnetometer(self, field):
        return None if self.field is None else self.update(np.array(field), self.field, MAGNETOMETER_STD)

    def update(self, measured, reference, std):
        """A vector that is known in the axes of the reference. Gives the innovation and its covariance, by which it is judged."""
        predicted = matrix(self.quat).T @ reference
        H = np.hstack([cross(predicted), np.zeros((3, 3))])
        residual, S = measured - predicted, H @ self.P @ H.T + np.eye(3) * std**2
        K = np.linalg.solve(S, H @ self.P).T
        correction = K @ residual
        self.P = (np.eye(6) - K @ H) @ self.P
        self.P = (self.P + self.P.T) / 2.0
        self.quat = times(self.quat, exp(correction[:3]))
        self.quat = self.quat / np.linalg.norm(self.quat)
        self.gyro_bias = self.gyro_bias + correction[3:]
        return residual, S

    def unseen(self, variance):
        self.P[:3, :3] += np.eye(3) * variance

    @property
    def covariance(self):
        return self.P[:3, :3]

    @property
    def gyro_bias_covariance(self):
        return self.P[3:, 3:]
