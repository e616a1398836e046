#!/usr/bin/env python3
"""Stone Soup's JPDA on the random scenes of `northing experiment tracking-worlds`, beside our trackers on the same detections.

    northing experiment tracking-worlds --worlds 80 --seed 5 --save scenes --json > scenes.json
    oracles/tracking_worlds.py scenes scenes.json [--each 4] [--processes 2] [--rows rows.json]

Constant velocity, detections as positions with the own ship's covariance added, gates and probabilities as the manifest tells them, tracks
from three detections, confirmed then, deleted after five scans without one. The density of the acceleration's noise is chosen for it: of three
the best one for each class on these very scenes. The score is GOSPA by Stone Soup's own
metric (p = 2, alpha = 2) with the scene's cut-off, over the instants with a true position, in cut-offs.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime, timedelta
from itertools import product
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import tomllib
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDAwithLBP
from stonesoup.deleter.error import CovarianceBasedDeleter
from stonesoup.deleter.multi import CompositeDeleter
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.array import StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState, State
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

START = datetime(2020, 1, 1)
#: Acceleration that lasts for a scan, in standard deviations of a detection along its range for each square of the interval.
ACCELERATIONS = (0.1, 0.3, 1.0)
#: Scans without a detection until a track is deleted.
PATIENCE = (5,)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


class Scene:
    """One recording as `northing track` reads it."""

    def __init__(self, path: Path):
        manifest = tomllib.loads(path.read_text())
        self.sensor = manifest["sensors"]["radar"]
        self.scans = rows(path.parent / manifest["scans"]["file"])
        self.detections = defaultdict(list)
        for row in rows(path.parent / manifest["detections"]["file"]) if "detections" in manifest else []:
            self.detections[row["scan"]].append((float(row["range_m"]), float(row["bearing_rad"])))
        self.truth = defaultdict(list)
        for row in rows(path.parent / manifest["truth"]["file"]) if "truth" in manifest else []:
            self.truth[row["scan"]].append((float(row["north_m"]), float(row["east_m"])))
        stamps = [float(scan["t_s"]) for scan in self.scans]
        self.interval = float(np.median(np.diff(stamps)))

    def place_std(self) -> float:
        return float(np.hypot(self.sensor["range_std_m"], self.sensor["extent_std_m"]))

    def placed(self, scan: dict[str, str]) -> set[Detection]:
        """The detections as positions in the plane, with their covariance and the own ship's."""
        north, east, heading, position_std, heading_std = (
            float(scan[name])
            for name in ("own_north_m", "own_east_m", "own_heading_deg", "own_position_std_m", "own_heading_std_deg")
        )
        stamp = START + timedelta(seconds=float(scan["t_s"]))
        found = set()
        for distance, bearing in self.detections[scan["scan"]]:
            angle = bearing + np.radians(heading)
            c, s = np.cos(angle), np.sin(angle)
            across = (distance * np.radians(self.sensor["bearing_std_deg"])) ** 2 + (distance * np.radians(heading_std)) ** 2
            turned = np.array([[c, -s], [s, c]])
            covariance = turned @ np.diag([self.sensor["range_std_m"] ** 2, across]) @ turned.T
            covariance += (position_std**2 + self.sensor["extent_std_m"] ** 2) * np.eye(2)
            place = np.array([[north + distance * c], [east + distance * s]])
            model = LinearGaussian(4, (0, 2), covariance)
            found.add(Detection(place, timestamp=stamp, measurement_model=model))
        return found


def merged(hypotheses, updater):
    """The estimate of a track from its hypotheses, each by its probability."""
    states, weights = [], []
    for hypothesis in hypotheses:
        states.append(updater.update(hypothesis) if hypothesis else hypothesis.prediction)
        weights.append(float(hypothesis.probability))
    mean, covariance = gm_reduce_single(
        StateVectors([state.state_vector for state in states]),
        np.stack([state.covar for state in states], axis=2),
        np.asarray(weights),
    )
    return GaussianStateUpdate(mean, covariance, hypotheses, hypotheses[0].measurement.timestamp)


def follow(scene: Scene, cutoff: float, acceleration: float, patience: int) -> float:
    """Mean GOSPA in cut-offs."""
    interval, std = scene.interval, scene.place_std()
    noise = (acceleration * std / interval**2) ** 2 * interval
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(noise)] * 2)
    predictor, updater = KalmanPredictor(motion), KalmanUpdater(None)
    clutter = scene.sensor["clutter_per_km2"] * 1e-6
    hypothesiser = PDAHypothesiser(predictor, updater, clutter, prob_detect=scene.sensor["detection_probability"], prob_gate=0.999)
    associator = JPDAwithLBP(hypothesiser)
    largest = scene.sensor["largest_range_m"]
    speed = np.hypot(2 * std, largest / 200) / interval
    deleter = CompositeDeleter(
        [UpdateTimeStepsDeleter(patience), CovarianceBasedDeleter((10 * speed * interval) ** 2 * 2, mapping=[0, 2])], intersect=False
    )
    prior = GaussianState([[0], [0], [0], [0]], np.diag([0, speed**2, 0, speed**2]), timestamp=START)
    starting = GNNWith2DAssignment(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3))
    initiator = MultiMeasurementInitiator(
        prior, deleter=UpdateTimeStepsDeleter(2), data_associator=starting, updater=updater, min_points=3
    )
    metric = GOSPAMetric(c=cutoff, p=2, switching_penalty=0.0)
    tracks, scores = set(), []
    for scan in scene.scans:
        stamp = START + timedelta(seconds=float(scan["t_s"]))
        found = scene.placed(scan)
        taken = set()
        for track, hypotheses in associator.associate(tracks, found, stamp).items():
            seen = [h for h in hypotheses if h]
            if seen:
                track.append(merged(hypotheses, updater))
                taken |= {h.measurement for h in seen}
            else:
                track.append(hypotheses[0].prediction)
        tracks -= deleter.delete_tracks(tracks)
        tracks |= initiator.initiate(found - taken, stamp)
        true = scene.truth[scan["scan"]]
        if true:
            places = [State(track.state_vector[[0, 2]], timestamp=stamp) for track in tracks]
            targets = [State(np.array([[north], [east]]), timestamp=stamp) for north, east in true]
            distance, _assignment = metric.compute_gospa_metric(places, targets)
            scores.append(distance.value["distance"])
    return float(np.mean(scores)) / cutoff if scores else 0.0


def run(job):
    path, cutoff, acceleration, patience = job
    began = time.process_time()
    score = follow(Scene(path), cutoff, acceleration, patience)
    return {"scene": path.stem, "acceleration": acceleration, "patience": patience, "gospa": score, "s": time.process_time() - began}


def chosen(scenes, each: int):
    """The first ones of each class, exact and wrong, of those that take minutes and not hours: ten targets, twelve false detections a scan."""
    count, kept = defaultdict(int), []
    for scene in scenes:
        about = scene["description"]
        kind = (about["class"], about["own_ship_error"] is None)
        if about["targets"] <= 10 and about["sensor"]["clutter_per_scan"] < 12 and count[kind] < each:
            count[kind] += 1
            kept.append(scene)
    return kept


def intervals(values) -> str:
    half = 1.96 * np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else float("nan")
    return f"{np.mean(values):.3f} +- {half:.3f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", type=Path, help="what `northing experiment tracking-worlds --json` printed of them")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--each", type=int, default=4, help="scenes of each class with the own ship exact, and as many with it wrong; default %(default)s"
    )
    parser.add_argument("--rows", type=Path, help="what was computed before is read here, and what is new is kept here")
    args = parser.parse_args()
    scenes = chosen(json.loads(args.scenes.read_text())["scenes"], args.each)
    done = json.loads(args.rows.read_text()) if args.rows and args.rows.exists() else []
    have = {(row["scene"], row["acceleration"], row["patience"]) for row in done}
    jobs = []
    for scene in scenes:
        about = scene["description"]
        name = f"{about['class']}-{about['number']}"
        for acceleration, patience in product(ACCELERATIONS, PATIENCE):
            if (name, acceleration, patience) not in have:
                jobs.append((args.folder / f"{name}.toml", about["cutoff_m"], acceleration, patience))
    with ProcessPoolExecutor(args.processes) as pool:
        for count, row in enumerate(pool.map(run, jobs), 1):
            done.append(row)
            print(f"\r{count} of {len(jobs)} runs", end="", file=sys.stderr)
            if args.rows and (count % 20 == 0 or count == len(jobs)):
                args.rows.write_text(json.dumps(done))
    print(file=sys.stderr)
    print(table(scenes, done))


def table(scenes, done) -> str:
    peer = {(row["scene"], row["acceleration"], row["patience"]): row["gospa"] for row in done}
    lines = [
        "| class | scenes | GOSPA, Stone Soup's JPDA | its acceleration, patience | ours: uncompensated | converted | schmidt | scenes in which ours is lower |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(scene["description"]["class"] for scene in scenes):
        for title, own_error in ((name, False), (f"{name}, own ship wrong", True)):
            chosen = [
                scene
                for scene in scenes
                if scene["description"]["class"] == name and (scene["description"]["own_ship_error"] is not None) == own_error
            ]
            if not chosen:
                continue
            names = [f"{name}-{scene['description']['number']}" for scene in chosen]
            best = min(product(ACCELERATIONS, PATIENCE), key=lambda s: np.mean([peer[n, *s] for n in names]))
            theirs = [peer[n, *best] for n in names]
            ours = [[score["gospa"] for score in scene["trackers"]] for scene in chosen]
            wins = sum(own[-1] < other for own, other in zip(ours, theirs))
            own = " | ".join(intervals(values) for values in zip(*ours))
            lines.append(f"| {title} | {len(chosen)} | {intervals(theirs)} | {best[0]}, {best[1]} | {own} | {wins} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
