#!/bin/bash
# Fits of one project, a seed each, as an array of SLURM jobs: sbatch slurm.sh PROJECT OUT
# A job begins while the queue has a licence to give; sent again, it goes on where it was.
#SBATCH --array=1-20
#SBATCH --licenses=marc:1
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=12:00:00
set -euo pipefail
project=$1
out=$2/seed-${SLURM_ARRAY_TASK_ID:?}
going_on=()
if [ -e "$out/run.json" ]; then going_on=(--resume); fi
exec bubblefit fit "$project" --starts 5 --seed "$SLURM_ARRAY_TASK_ID" --jobs 1 --quiet \
    --out "$out" "${going_on[@]}"
