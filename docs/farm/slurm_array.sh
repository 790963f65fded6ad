#!/bin/bash
#SBATCH --job-name=prt
#SBATCH --cpus-per-task=2
#SBATCH --time=04:00:00
# A planned bake as arrays of SLURM jobs, one array for each stage:
#
#   prt bake scene.blend --plan -o /shared/scene.prt
#   bash slurm_array.sh /shared/scene.prt 32       # on the login node, or as a small job by sbatch
#
# The store lies where all nodes see it: a shared folder or s3://BUCKET/NAME.prt. What is killed or
# runs out of time is done by the next array; the whole script may be run again at any time.
# Light fields and sequences have no stages: they are one array each, without this script.
set -uo pipefail
store=${1:?usage: slurm_array.sh NAME.prt [JOBS]}
jobs=${2:-16}
prt=${PRT:-prt}

if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    # One job of the array: its share of the blocks that are missing, on the cores it was given.
    export PRT_THREADS=${SLURM_CPUS_PER_TASK:-1}
    first=${SLURM_ARRAY_TASK_MIN:-0}
    exec $prt bake-blocks "$store" --quiet \
        --share "$((SLURM_ARRAY_TASK_ID - first))/${SLURM_ARRAY_TASK_COUNT:-$jobs}"
fi

before=
while true; do
    # Closes the bake, or opens the next stage: then it says what is missing, with exit code 3.
    missing=$($prt bake --finish "$store" --quiet 2>&1)
    code=$?
    echo "$missing"
    [ $code -eq 3 ] || exit $code
    if [ "$missing" = "$before" ]; then
        echo "slurm_array.sh: the last array has computed nothing; see the logs of its jobs" >&2
        exit 1
    fi
    before=$missing
    # Jobs that fail leave blocks that are still missing, which the next array does.
    sbatch --wait --array="0-$((jobs - 1))" "$0" "$store" "$jobs" || true
done
