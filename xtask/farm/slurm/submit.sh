#!/usr/bin/env bash
# Submits a picture to Slurm: photons in shards, merged; tiles, assembled. Prints the number of the last job.
#
#   SHARDS=8 TILES=16 RESOLUTION=4096x4096 submit.sh SCENE FOLDER
#
# FOLDER lies on a disk that all nodes share. An element that fails twice is queued again, RETRIES times; so is one
# whose node is lost, by Slurm. If a job fails for good, those that depend on it are canceled: the same command goes on with what is
# missing. Whatever else nodes need (partition, account, memory, time) comes from the variables that sbatch reads
# (SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_MEM_PER_NODE, SBATCH_TIMELIMIT ...).
set -euo pipefail

if [ $# -ne 2 ]; then
    echo "usage: [NAME=VALUE ...] $0 SCENE FOLDER" >&2
    exit 2
fi
SCENE="$(realpath "$1")"
mkdir -p "$2"
FOLDER="$(realpath "$2")"
export SCENE FOLDER
export NAME="${NAME:-picture}"
export PHOTONS="${PHOTONS:-1M}"
export SHARDS="${SHARDS:-8}"
export RESOLUTION="${RESOLUTION:-1024x1024}"
export TILES="${TILES:-16}"
export MODE="${MODE:-original}"
# Of mode adaptive.
export ERROR="${ERROR:-0.01}"
export SEED="${SEED:-0}"
export RETRIES="${RETRIES:-2}"
# The programs, by their paths or by names that are found on all nodes.
export PHOTON_BUILD="${PHOTON_BUILD:-photon-build}"
export RENDER_CACHED="${RENDER_CACHED:-render-cached}"

# What is there is not made again: it must not be of another picture.
settings="$SCENE $PHOTONS photons in $SHARDS shards, $RESOLUTION in $TILES tiles, mode $MODE $ERROR, seed $SEED"
if [ -e "$FOLDER/$NAME.settings" ] && [ "$(cat "$FOLDER/$NAME.settings")" != "$settings" ]; then
    echo "$0: $FOLDER holds a picture of this name with other settings; choose another folder or NAME" >&2
    exit 1
fi
echo "$settings" >"$FOLDER/$NAME.settings"

element="$(dirname "$(realpath "$0")")/element.sh"

# The number of a job that does this step after the jobs before have done theirs.
job() {
    local step="$1" after="$2"
    shift 2
    sbatch --parsable --requeue --kill-on-invalid-dep=yes --job-name="tetralux-$step" \
        --output="$FOLDER/$NAME-$step-%j.log" --open-mode=append \
        ${after:+--dependency="afterok:$after"} "$@" "$element" "$step" | cut -d ';' -f 1
}

photons="$(job photons "" --array="1-$SHARDS")"
merge="$(job merge "$photons")"
before="$merge"
if [ "$MODE" = adaptive ]; then
    before="$(job layers "$merge")"
fi
tiles="$(job tile "$before" --array="1-$TILES")"
job assemble "$tiles"
