# %% [markdown]
# # A multiplicative EKF from scratch, and against ours
#
# A Kalman filter estimates numbers that can be added. Attitudes cannot: a quaternion has four numbers for three degrees of
# freedom. The multiplicative filter keeps the attitude as a quaternion and estimates a small rotation beside it, the error,
# which can be added as long as it is small. Sixty lines of numpy are enough; then it runs beside the filters of the project.

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

phone = no.virtual_phone(seed=11, duration=75.0, motion="brisk")
recording = phone.save("mekf.csv", force=True)

# %% [markdown]
# ## Rotations
#
# Quaternions are w, x, y, z and turn body axes into the axes of the reference: $v_{ref} = R(q) v_{body}$. The error is local,
# $q_{true} = q \otimes \exp(a)$, with $a$ in body axes.

# %%
def cross(v):
    """cross(v) @ u is v x u."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def times(p, q):
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def exp(v):
    half = np.linalg.norm(v) / 2.0
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) * v / 2.0])


def matrix(q):
    v = cross(q[1:])
    return np.eye(3) + 2.0 * q[0] * v + 2.0 * v @ v


# a quarter turn about z takes the body's x axis to the reference's y axis
assert np.allclose(matrix(exp(np.array([0.0, 0.0, np.pi / 2]))) @ [1, 0, 0], [0, 1, 0])

# %% [markdown]
# ## The filter
#
# *Propagation.* The gyroscope measures $\omega_m = \omega + b + \eta$. Turning the attitude by $(\omega_m - \hat b)\,dt$ leaves the
# error $a \leftarrow \exp(-\omega dt)\,a - dt\,\Delta b$.
#
# *Update.* A vector $r$ that is known in the reference is seen as $R^T r$. With the error it is
# $\hat R^T r + [\hat R^T r]_\times a$: that is the row of the measurement matrix.
#
# The class derives from `no.Estimator`: whatever it keeps as `quat`, `covariance` and `gyro_bias` is what the estimator says, and
# what an update returns, residual and covariance, is what it is judged by. The driver hands it the alignment as a start.

# %%
class Mine(no.Estimator):
    gyroscope_noise, bias_walk = 1e-3, 1e-5           # (rad/s)/sqrt(Hz), (rad/s)/sqrt(s)
    accelerometer_std, magnetometer_std = 0.05, 0.5   # m/s^2, microtesla

    def start(self, quat, covariance, gyro_bias, gyro_bias_std, force, field):
        self.quat, self.gyro_bias = np.array(quat), np.array(gyro_bias)
        self.force, self.field = np.array(force), np.array(field)
        self.P = np.zeros((6, 6))
        self.P[:3, :3], self.P[3:, 3:] = covariance, np.eye(3) * gyro_bias_std**2

    def gyroscope(self, rate, dt):
        turn = exp((np.array(rate) - self.gyro_bias) * dt)
        self.quat = times(self.quat, turn)
        F = np.eye(6)
        F[:3, :3], F[:3, 3:] = matrix(turn).T, -np.eye(3) * dt
        self.P = F @ self.P @ F.T + np.diag(np.repeat([self.gyroscope_noise**2 * dt, self.bias_walk**2 * dt], 3))

    def accelerometer(self, force):
        return self.update(np.array(force), self.force, self.accelerometer_std)

    def magnetometer(self, field):
        return self.update(np.array(field), self.field, self.magnetometer_std)

    def update(self, measured, reference, std):
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

    @property
    def covariance(self):
        return self.P[:3, :3]

    @property
    def gyro_bias_covariance(self):
        return self.P[3:, 3:]


# %% [markdown]
# ## Mine and ours on the same samples
#
# The class stands where a name of an estimator stands. Ours gates outliers, weighs the magnetometer by heading alone if asked to,
# and costs half a microsecond a sample; the mathematics is the same.

# %%
mine, ours = recording.run(Mine), recording.run("mekf", profile="lab")
for run in (mine, ours):
    summary = run.summary
    print(f"{run.estimator:6} {summary['error_deg']['total_rmse']:5.2f} deg RMS,", *(f"{v.sensor}: {v.verdict}" for v in run.verdicts))
assert mine.summary["error_deg"]["total_rmse"] < 2.0 * ours.summary["error_deg"]["total_rmse"] + 0.5

figure, (angles, bias) = plt.subplots(2, 1, sharex=True, figsize=(9, 6), layout="constrained")
for run, style in ((mine, "-"), (ours, "--")):
    t = run.t - run.t[0]
    angles.plot(t, np.degrees(run.yaw_pitch_roll[:, 2]), style, linewidth=0.9, label=f"{run.estimator}: roll")
    for i, axis in enumerate("xyz"):
        bias.plot(t, np.degrees(run.gyro_bias[:, i]), style, color=f"C{i}", linewidth=0.9, label=f"{run.estimator}: {axis}")
angles.set(ylabel="deg")
bias.set(ylabel="gyroscope bias, deg/s", xlabel="s")
for panel in (angles, bias):
    panel.legend(loc="upper right", fontsize="small", ncols=2)

# %% [markdown]
# ## A wrong filter is caught
#
# State the accelerometer as five times better than it is: at first sight the estimate hardly changes, and the verdict says what is
# wrong, without any truth.

# %%
class Overconfident(Mine):
    accelerometer_std = 0.01


caught = recording.run(Overconfident)
for verdict in caught.verdicts:
    print(verdict, end="\n\n")
assert {v.sensor: v.verdict for v in caught.verdicts}["accelerometer"] != {v.sensor: v.verdict for v in mine.verdicts}["accelerometer"]

# %% [markdown]
# **Exercise.** Replace the update by a fixed gain (a complementary filter): `correction = gain * cross(predicted) @ measured`, with
# `covariance = None`. What does it lose against the Kalman filter while the bias is unknown? In a file, `mine.py`, it runs in the
# live lab beside ours: `northing live --estimator mine.py:Mine`.
