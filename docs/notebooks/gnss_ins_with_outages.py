# %% [markdown]
# # GNSS/INS with outages
#
# A car with an inertial unit and a GNSS receiver drives for three minutes; for half a minute the receiver sees nothing, as in a
# tunnel. An inertial unit alone drifts with time squared and cubed: how far, and does the filter know it?

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

drive = no.virtual_vehicle("car-smooth", seed=20, duration=180.0)
print(drive.description)

# %% [markdown]
# ## Sample by sample
#
# The GNSS/INS takes inertial samples and fixes in the order of their stamps. Every measurement returns its innovation; the filter
# finds its attitude while the car moves and says when the heading is not known yet. Fixes between 90 s and 120 s are kept from it.

# %%
OUTAGE = (90.0, 120.0)


def run(config=None):
    ins, rows = no.GnssIns(config), []
    events = [(int(t), 0, k) for k, t in enumerate(drive["gyr_time_ns"])]
    for kind, sensor in enumerate(("gnss", "gnss_velocity"), 1):
        stamps = drive[f"{sensor}_time_ns"]
        events += [(int(t), kind, k) for k, t in enumerate(stamps) if not OUTAGE[0] <= t * 1e-9 < OUTAGE[1]]
    nis = []
    for time_ns, kind, k in sorted(events):
        if kind == 0:
            ins.imu(time_ns, drive["gyr"][k], drive["acc"][k])
            if k % 10 == 0 and ins.ned is not None:
                rows.append((time_ns * 1e-9, *ins.ned, *np.sqrt(np.diag(ins.position_covariance)), ins.validity))
        elif kind == 2:
            ins.gnss_velocity(time_ns, drive["gnss_velocity"][k], std=drive["gnss_velocity_std"][k])
        else:
            horizontal, _ = ins.gnss_position(time_ns, *drive["gnss_geodetic"][k], std=drive["gnss_std"][k])
            if horizontal.degrees_of_freedom:
                nis.append((time_ns * 1e-9, horizontal.nis))
    return ins, rows, np.array(nis)


ins, rows, nis = run()
t, north, east, down, std_n, std_e, std_d = np.array([row[:7] for row in rows]).T
status = np.array([row[7] for row in rows])
for word in dict.fromkeys(status):
    print(f"{word}: {np.mean(status == word) * np.ptp(t):.0f} s")

# %% [markdown]
# ## The track, and the error against what is stated

# %%
true_t = drive["true_time_ns"] * 1e-9
origin = drive["gnss_ned"][0]
truth = np.stack([np.interp(t, true_t, drive["true_antenna_ned"][:, i]) for i in range(2)], axis=1) - origin[:2]
error = np.stack([north, east], axis=1) - truth
fixes = drive["gnss_ned"] - origin

figure, (track, off) = plt.subplots(1, 2, figsize=(11, 5), width_ratios=(1, 2), layout="constrained")
track.plot(truth[:, 1], truth[:, 0], color="0.6", linewidth=3, label="truth")
track.plot(east, north, linewidth=1, label="GNSS/INS")
track.plot(fixes[:, 1], fixes[:, 0], ".", markersize=3, color="C1", label="fixes")
gone = (t >= OUTAGE[0]) & (t < OUTAGE[1])
track.plot(east[gone], north[gone], color="C3", linewidth=2, label="without fixes")
track.set(xlabel="east, m", ylabel="north, m", aspect="equal")
figure.legend(*track.get_legend_handles_labels(), loc="outside upper left", ncols=4, fontsize="small")
distance, stated = np.linalg.norm(error, axis=1), np.sqrt(5.99) * np.sqrt((std_n**2 + std_e**2) / 2)
off.fill_between(t, 0, stated, color="0.85", label="stated 95 %")
off.plot(t, distance, linewidth=0.9, label="error")
off.axvspan(*OUTAGE, color="C3", alpha=0.1)
off.set(xlabel="s", ylabel="horizontal, m", yscale="log", ylim=(0.01, None))
off.legend(fontsize="small")
print(f"at the end of the outage: {distance[gone][-1]:.1f} m off, {stated[gone][-1]:.1f} m stated (95 %)")
print(f"inside the stated 95 %: {100 * np.mean(distance < stated):.0f} %")

# %% [markdown]
# ## Innovations
#
# The normalised innovation squared of a horizontal fix has a mean of 2 where the stated noise is right. The first fix after the
# outage is far off, and expected to be.

# %%
figure, panel = plt.subplots(figsize=(9, 3), layout="constrained")
panel.semilogy(nis[:, 0], np.maximum(nis[:, 1], 1e-3), ".", markersize=4)
panel.axhline(2.0, color="0.3", linewidth=0.8)
panel.axvspan(*OUTAGE, color="C3", alpha=0.1)
panel.set(xlabel="s", ylabel="NIS of the horizontal fix")
print(f"mean NIS: {nis[:, 1].mean():.2f}")

# %% [markdown]
# ## The same from a file, smoothed
#
# `save` writes a recording; the run over it is that of `northing run drive.csv --estimator error-state --outage 90:30`. A smoother
# also uses the fixes after the outage.

# %%
recording = drive.save("drive.csv", force=True)
for smooth in (False, True):
    over = recording.run("error-state", outages=["90:30"], smooth=smooth)
    (outage,) = over.summary["outages"]
    print(
        f"{'smoothed' if smooth else 'filtered'}: {over.summary['position']['horizontal_rmse_m']:.2f} m RMS; at the end of the outage "
        f"{outage['horizontal_error_m']:.1f} m off, {outage['predicted_std_m']:.1f} m stated (one standard deviation); "
        f"the last fix moved on: {outage['extrapolation_error_m']:.0f} m"
    )
