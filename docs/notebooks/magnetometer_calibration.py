# %% [markdown]
# # Magnetometer calibration: hard and soft iron
#
# A magnetometer measures the Earth's field and that of everything magnetic in the device. What turns with the device is a constant
# offset in body axes (hard iron); material that the field magnetises stretches and shears it (soft iron). Turned in all
# directions, a clean sensor draws a sphere about the origin, a real one a displaced ellipsoid.

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

random = np.random.default_rng(3)
hard_iron = np.array([18.0, -9.0, 12.0])                                     # microtesla
soft_iron = np.array([[1.08, 0.03, -0.02], [0.03, 0.94, 0.04], [-0.02, 0.04, 1.02]])

phone = no.virtual_phone(seed=4, duration=75.0, motion="tumble")
clean = phone["mag"]
measured = clean @ soft_iron.T + hard_iron

# %% [markdown]
# ## A recording of the distorted sensor
#
# The module's tables have a unit in every column name; so has a file that `no.open` reads as it is.

# %%
import pandas

rows = np.searchsorted(phone["gyr_time_ns"], phone["mag_time_ns"])
rows = np.minimum(rows, len(phone["gyr"]) - 1)
columns = {"t_ns": phone["gyr_time_ns"][rows]}
acc_rows = np.minimum(np.searchsorted(phone["acc_time_ns"], phone["mag_time_ns"]), len(phone["acc"]) - 1)
for name, values in (("gyro_{}_rad_s", phone["gyr"][rows]), ("acc_{}_m_s2", phone["acc"][acc_rows]), ("mag_{}_ut", measured)):
    columns.update({name.format(axis): values[:, i] for i, axis in enumerate("xyz")})
table = pandas.DataFrame(columns).drop_duplicates("t_ns")
table.to_csv("distorted.csv", index=False)
recording = no.open("distorted.csv")
recording

# %% [markdown]
# ## The fit
#
# An ellipsoid is fitted to the samples; which model the samples justify (offset alone, or offset and shape) is decided by their
# noise. The fit says how well it knows each number, and refuses a recording whose directions are too few.

# %%
made = no.calibrate.magnetometer(recording)
print(*made["sentences"], sep="\n")
found = made["calibration"]["calibration"]
for axis, true, value, std in zip("xyz", hard_iron, found["hard_iron_ut"], found["hard_iron_std_ut"]):
    print(f"hard iron {axis}: {value:6.2f} ± {std:.2f} microtesla, in truth {true:.2f}")
assert np.all(np.abs(np.subtract(found["hard_iron_ut"], hard_iron)) < 5 * np.array(found["hard_iron_std_ut"]) + 0.05)

# %%
figure, axes = plt.subplots(1, 3, figsize=(11, 4), layout="constrained")
for panel, (i, j) in zip(axes, ((0, 1), (0, 2), (1, 2))):
    panel.plot(measured[:, i], measured[:, j], ".", markersize=1, color="C3", label="measured")
    panel.plot(clean[:, i], clean[:, j], ".", markersize=1, color="C0", label="without iron")
    panel.plot(*np.take(found["hard_iron_ut"], (i, j)), "k+", markersize=6, label="hard iron, fitted")
    panel.set(xlabel=f"{'xyz'[i]}, µT", ylabel=f"{'xyz'[j]}, µT", aspect="equal")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize="small", markerscale=3);

# %% [markdown]
# ## What the calibration changes: heading with and without
#
# The same filter on the distorted recording, with the calibration and without.

# %%
common = {"estimator": "mekf", "profile": "lab"}
truth = phone["true_quat"]


def heading_error(run):
    """Degrees, wrapped, at the stamps of the truth."""
    stamps, at, of = np.intersect1d(run.time_ns, phone["true_time_ns"], return_indices=True)
    w, x, y, z = truth[of].T
    true_yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    off = np.degrees(run.yaw_pitch_roll[at, 0] - true_yaw)
    return (stamps - stamps[0]) * 1e-9, (off + 180.0) % 360.0 - 180.0


raw = recording.run(**common)
corrected = recording.run(**common, magnetometer_calibration=made)
figure, panel = plt.subplots(figsize=(9, 3.5), layout="constrained")
rms = {}
for run, label in ((raw, "as measured"), (corrected, "calibrated")):
    t, off = heading_error(run)
    rms[label] = np.sqrt(np.nanmean(off**2))
    panel.plot(t, off, linewidth=0.8, label=f"{label}: {rms[label]:.1f}° RMS")
panel.set(xlabel="s", ylabel="heading error, deg")
panel.legend()
assert rms["calibrated"] < rms["as measured"]
