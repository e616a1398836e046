# %% [markdown]
# # Tuning by innovations
#
# Nobody knows Q and R of a sensor on a given device. Data sheets state what the sensor does on a bench, not what a hand or an engine
# does to it. But the innovations know: under the right noise their likelihood is largest. No truth is needed.

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

phone = no.virtual_phone(seed=3, duration=75.0)
recording = phone.save("tuning.csv", force=True)

# %% [markdown]
# ## A wrong start
#
# The accelerometer and the magnetometer are stated ten times as noisy as they are. The estimate still looks well; the verdicts say
# what is wrong, and by how much.

# %%
wrong = {"accelerometer_std": 0.5, "magnetometer_std_ut": 5.0}
start = recording.run("mekf", profile="lab", **wrong)
for verdict in start.verdicts:
    print(verdict, end="\n\n")

# %% [markdown]
# ## By hand: the likelihood over one parameter
#
# For each candidate the filter runs once; the log-likelihood of its innovations is
# $-\tfrac12 \sum (\mathrm{NIS} + \ln\det S)$, up to a constant.

# %%
def log_likelihood(run, sensor):
    told = run.innovations[sensor]
    used = told["degrees_of_freedom"] == 3
    _, logdet = np.linalg.slogdet(told["covariance"][used])
    return -0.5 * np.sum(told["nis"][used] + logdet)


candidates = np.geomspace(0.15, 5.0, 9)
runs = [recording.run("mekf", profile="lab", magnetometer_std_ut=float(std)) for std in candidates]
values = np.array([log_likelihood(run, "magnetometer") for run in runs])
means = [np.nanmean(run.nis["magnetometer"]) for run in runs]
best = candidates[values.argmax()]

figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
top.plot(candidates, values - values.max(), "o-")
top.set(ylabel="log-likelihood, less its best")
bottom.plot(candidates, means, "o-")
bottom.axhline(3.0, color="0.3", linewidth=0.8)
bottom.set(xscale="log", yscale="log", xlabel="magnetometer_std_ut, µT", ylabel="mean NIS; 3 is consistent")
print(f"best of these: {best:.2f} microtesla")

# %% [markdown]
# ## Several noises at once
#
# `no.tune` searches over the noises that are named, without names over all that make a difference, on the first part of the recording, and says what the rest, which it
# has not seen, thinks of the result. Program: `northing tune tuning.csv --estimator mekf`.

# %%
tuned = no.tune(recording, "mekf", profile="lab", parameters=["accelerometer_std", "magnetometer_std_ut"])
for one in tuned["parameters"]:
    print(f"{one['name']:26} {one['before']:.4g} -> {one['after']:.4g}")
print(f"log-likelihood a sample of the part that the fit has not seen: {-tuned['before']['held_out']:.4f} -> {-tuned['after']['held_out']:.4f}")

# %% [markdown]
# Fitted values go into a run as parameters; a run with them has consistent verdicts.

# %%
fitted = {one["name"]: one["after"] for one in tuned["parameters"]}
after = recording.run("mekf", profile="lab", **fitted)
for verdict in after.verdicts:
    print(verdict, end="\n\n")
assert all(verdict.verdict == "consistent" for verdict in after.verdicts)
