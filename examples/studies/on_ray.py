"""A study on Ray: one shard a task, tried again where a worker dies, the parts merged at the end.

python on_ray.py study.toml parts --shards 16 --out study.parquet

Needs Ray (pip install ray) and the program `northing` on every machine, and a folder that all of them see. A shard that is tried again
goes on where it was: its part files are there.
"""

import argparse
import json
import shutil
import subprocess

import ray


def shard(program: str, study: str, parts: str, index: int, shards: int, threads: int) -> int:
    """Runs one shard, counted from 0, and returns how many runs the folder then holds."""
    command = [program, "study", study, "--out", parts, "--json", "--threads", str(threads)]
    command += ["--shard-index", str(index), "--shards", str(shards)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    return json.loads(done.stdout)["runs_held"]


def run(program: str, study: str, parts: str, shards: int, threads: int, retries: int) -> dict:
    """Runs all shards on the cluster that `ray.init` found, merges their parts, and returns what `study --json` prints."""
    task = ray.remote(max_retries=retries, num_cpus=threads)(shard)
    ray.get([task.remote(program, study, parts, index, shards, threads) for index in range(shards)])
    merged = subprocess.run([program, "study", "merge", parts, "--json"], capture_output=True, text=True, check=True)
    return json.loads(merged.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description="A study on Ray.")
    parser.add_argument("study", help="study.toml, where all machines see it")
    parser.add_argument("parts", help="folder of the part files, where all machines see it")
    parser.add_argument("--shards", type=int, default=16, help="pieces of the study")
    parser.add_argument("--threads", type=int, default=1, help="threads, and processors, of a shard")
    parser.add_argument("--retries", type=int, default=5, help="times that a shard is tried again where its worker died")
    parser.add_argument("--program", default=shutil.which("northing") or "northing", help="the program")
    parser.add_argument("--out", help="one table, a row a run (.parquet)")
    args = parser.parse_args()
    ray.init()
    outcome = run(args.program, args.study, args.parts, args.shards, args.threads, args.retries)
    if args.out:
        subprocess.run([args.program, "study", "merge", args.parts, "--out", args.out], check=True)
    print(f"{outcome['runs_held']} of {outcome['runs']} runs, hash {outcome['hash']}")


if __name__ == "__main__":
    main()
