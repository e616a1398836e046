# %% [markdown]
# # Attitude of a phone, from file to verdict
#
# A phone lies on a table, is turned about by hand, and is put down again. Which way did it point, how sure is that, and is the
# stated uncertainty true? The recording is simulated, so the truth is known; with a file of your own the lines are the same.

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

phone = no.virtual_phone(seed=7, duration=75.0, motion="brisk")
recording = phone.save("phone.csv", force=True)
recording

# %% [markdown]
# ## What the sensors say
#
# `arrays` gives the samples of one sensor, with stamps. At rest the accelerometer measures +9.81 m/s² on the axis that points up:
# the specific force, not "acceleration".

# %%
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(9, 6), layout="constrained")
for panel, sensor, unit in zip(axes, ("gyroscope", "accelerometer", "magnetometer"), ("rad/s", "m/s²", "µT")):
    samples = recording.arrays(sensor)
    for axis, values in zip("xyz", samples.values.T):
        panel.plot(samples.t - samples.t[0], values, linewidth=0.7, label=axis)
    panel.set(ylabel=unit, title=sensor)
axes[0].legend(loc="upper right", ncols=3)
axes[-1].set(xlabel="s");

# %% [markdown]
# ## The estimate
#
# One line runs an estimator, here the multiplicative extended Kalman filter with the settings of a laboratory. It aligns itself on the
# first half second; from then on there is an estimate at every sample of the gyroscope.

# %%
run = recording.run("mekf", profile="lab")
print(run)
print(f"{len(run)} estimates from {run.t[0]:.2f} s on, the last: yaw, pitch, roll", np.degrees(run.yaw_pitch_roll[-1]).round(2), "deg")

# %% [markdown]
# ## Errors against the stated uncertainty
#
# The covariance is that of the local attitude error, in body axes. The error of a good filter stays inside three standard
# deviations for 99.7 % of the time, on each axis.

# %%
def turned(p, q):
    """The rotation vector from attitude p to attitude q, in body axes of p: the logarithm of p* q."""
    w = np.sum(p * q, axis=1)
    v = p[:, :1] * q[:, 1:] - q[:, :1] * p[:, 1:] - np.cross(p[:, 1:], q[:, 1:])
    sign = np.where(w < 0, -1.0, 1.0)[:, None]
    norm = np.linalg.norm(v, axis=1, keepdims=True)
    return 2 * sign * v * np.where(norm > 1e-12, np.arctan2(norm, np.abs(w)[:, None]) / np.maximum(norm, 1e-12), 1.0)


common, at, of = np.intersect1d(run.time_ns, phone["true_time_ns"], return_indices=True)
error, std = turned(run.quat[at], phone["true_quat"][of]), run.std[at]
t = (common - common[0]) * 1e-9

figure, axes = plt.subplots(3, 1, sharex=True, figsize=(9, 6), layout="constrained")
for i, panel in enumerate(axes):
    panel.fill_between(t, -3 * np.degrees(std[:, i]), 3 * np.degrees(std[:, i]), color="0.85", label="±3 standard deviations")
    panel.plot(t, np.degrees(error[:, i]), linewidth=0.8, label="error")
    panel.set(ylabel=f"about {'xyz'[i]}, deg", ylim=(-1.5, 1.5))
axes[0].legend(loc="upper right")
axes[-1].set(xlabel="s")
known = ~np.isnan(error[:, 0])
inside = np.mean(np.abs(error[known]) < 3 * std[known])
print(f"inside: {100 * inside:.1f} %")
assert inside > 0.9

# %% [markdown]
# ## Verdicts: without a truth
#
# Outside a laboratory there is no truth. What is left are the innovations, measured less predicted: if the stated noise is right
# their normalised square (NIS) has a mean of 3 for a vector. Each sensor gets a verdict in words.

# %%
for verdict in run.verdicts:
    print(verdict, end="\n\n")

figure, panel = plt.subplots(figsize=(9, 3), layout="constrained")
for sensor, nis in run.nis.items():
    stamps = run.innovations[sensor]["time_ns"]
    panel.plot((stamps - run.time_ns[0]) * 1e-9, nis, ".", markersize=2, label=sensor)
panel.axhline(3.0, color="0.3", linewidth=0.8, label="expected mean")
panel.set(yscale="log", ylim=(1e-2, 1e3), xlabel="s", ylabel="NIS")
panel.legend(loc="upper right");

# %% [markdown]
# ## Compare, report, save
#
# The same recording through several estimators, the report that the program writes, and the estimates as a table. The same from
# a shell: `northing compare phone.csv`, `northing run phone.csv --estimator mekf --profile lab --report phone.html`.

# %%
for one in no.compare([recording], ["mekf", "bounded-velocity", "complementary", "integration", "device"], profile="lab"):
    print(f"{one['estimator']:18} {one['error_deg']['total_rmse']:6.2f} deg RMS")

run.report("phone.html", force=True)
run.save("attitude.csv", force=True)
run.to_pandas().tail(3)
