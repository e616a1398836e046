# %% [markdown]
# # Tracking from a ship with an uncertain compass
#
# A radar measures range and bearing from the own ship. Where the ship points comes from its navigation, which is off by a degree
# or two, and stays off for a while: at two kilometres that is fifty metres, in the same direction at every scan. A tracker that
# treats it as fresh noise averages it away, and is sure of a wrong position. The scenario is that of Wilthil & Brekke (2016).

# %%
import matplotlib.pyplot as plt
import numpy as np

import northing as no

run = no.simulate("wilthil-brekke", seed=5, trackers=["schmidt-black-box", "uncompensated", "converted"])
run

# %% [markdown]
# ## One run
#
# Truth, the ship's navigation, detections and three trackers are the columns of the run.

# %%
figure, (chart, off) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
chart.plot(run["own_east_m"], run["own_north_m"], color="0.3", label="own ship")
chart.plot(run["target_east_m"], run["target_north_m"], color="0.6", linewidth=3, label="target")
bearing = run["nav_heading_rad"] + run["bearing_rad"]
chart.plot(run["nav_east_m"] + run["range_m"] * np.sin(bearing), run["nav_north_m"] + run["range_m"] * np.cos(bearing), ".",
           markersize=2, color="C1", label="detections, as the navigation places them")
chart.plot(run["schmidt-black-box_east_m"], run["schmidt-black-box_north_m"], linewidth=1, color="C0", label="Schmidt-Kalman")
chart.set(xlabel="east, m", ylabel="north, m", aspect="equal", ylim=(-900, None))
chart.legend(loc="lower left", fontsize="small")
off.plot(run["time_s"], np.degrees(run["own_heading_rad"] - run["nav_heading_rad"]), linewidth=0.9, label="heading error")
std = np.degrees(run["nav_heading_std_rad"])
off.fill_between(run["time_s"], -3 * std, 3 * std, color="0.85", label="±3 standard deviations")
off.set(xlabel="s", ylabel="own heading, deg")
off.legend(fontsize="small");

# %% [markdown]
# ## The tracker by hand
#
# The Schmidt-Kalman tracker carries the covariance between the pose's error and the target, and does not estimate that error. Each
# scan is one call with the own pose of that moment; it returns the innovation.

# %%
names = ("north_north_m2", "north_east_m2", "north_heading_m_rad", "east_east_m2", "east_heading_m_rad", "heading_heading_rad2")


def ship(k):
    nn, ne, nh, ee, eh, hh = (run[f"nav_cov_{name}"][k] for name in names)
    covariance = [[nn, ne, nh], [ne, ee, eh], [nh, eh, hh]]
    return no.OwnShip(run["nav_north_m"][k], run["nav_east_m"][k], run["nav_heading_rad"][k], covariance=covariance)


noise = {"range_std": 20.0, "bearing_std": np.radians(1.0), "acceleration_std": 0.05, "velocity_std": 8.0}
target = no.SchmidtKalman(0, run["range_m"][0], run["bearing_rad"][0], ship(0), **noise,
                          position_correlation_s=0.41, heading_correlation_s=3.3)
track, nis = [target.track], []
for k in range(1, len(run)):
    told = target.scan(k * 1_000_000_000, run["range_m"][k], run["bearing_rad"][k], ship(k))
    track.append(target.track)
    nis.append(told.nis)
track = np.array(track)
long, short, direction = target.ellipse(0.95)
print(f"95 % ellipse at the end: {long:.0f} m by {short:.0f} m towards {np.degrees(direction) % 180:.0f} deg; mean NIS {np.mean(nis):.2f} of 2")
np.testing.assert_allclose(track[-1, 0], run["schmidt-black-box_north_m"][-1], rtol=1e-6)

# %% [markdown]
# ## Is it true? Sixty runs
#
# One run proves nothing. Over many the error squared in units of the stated covariance (NEES) has a mean of 4 for a consistent
# tracker of position and velocity. A campaign splits over machines and merges to the last digit: `shard=(3, 16)`.

# %%
campaign = no.montecarlo("wilthil-brekke", runs=60, trackers=["schmidt-black-box", "converted", "uncompensated", "true-pose"])
figure, panel = plt.subplots(figsize=(9, 4), layout="constrained")
for name, told in campaign.summary["trackers"].items():
    series = told["series"]
    panel.semilogy(series["time_s"], series["nees"], linewidth=0.9, label=f"{name}: NEES {told['nees_mean']:.2f}")
panel.axhspan(*campaign.summary["nees_band"], color="0.85", label="95 % band of a consistent tracker")
panel.set(xlabel="s", ylabel="NEES, mean of 60 runs")
panel.legend(fontsize="small");
