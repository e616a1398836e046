#!/bin/bash
#SBATCH --job-name=northing-study
#SBATCH --array=0-15
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=1G
#SBATCH --time=04:00:00
#SBATCH --requeue
# A study as a Slurm array: one shard a task, parts in one folder that all tasks see. Submit: sbatch slurm.sh study.toml parts
# A task that was cut off and is queued again goes on where it was. When all are done: northing study merge parts --out study.parquet

set -euo pipefail

study=${1:?which study? sbatch slurm.sh study.toml parts}
parts=${2:?which folder for the parts? sbatch slurm.sh study.toml parts}
: "${SLURM_ARRAY_TASK_ID:?it is not an array task; submit it with sbatch}"

exec northing study "$study" \
    --shard-index "$((SLURM_ARRAY_TASK_ID - ${SLURM_ARRAY_TASK_MIN:-0}))" \
    --shards "${SLURM_ARRAY_TASK_COUNT:-16}" \
    --threads "${SLURM_CPUS_PER_TASK:-1}" \
    --out "$parts"
