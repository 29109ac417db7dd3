#!/usr/bin/env bash
# One element of a step, as submit.sh submits it. Outputs appear whole or not at all: one that is there is not made again.
set -uo pipefail
cd "$FOLDER"

case "$1" in
photons)
    output="$NAME-$SLURM_ARRAY_TASK_ID-of-$SHARDS.shard"
    command=("$PHOTON_BUILD" "$SCENE" --photons "$PHOTONS" --seed "$SEED"
        --shard "$SLURM_ARRAY_TASK_ID/$SHARDS" -o "$output")
    ;;
merge)
    output="$NAME.photons"
    command=("$PHOTON_BUILD" merge "$NAME"-*-of-"$SHARDS".shard -o "$output")
    ;;
layers)
    output="$NAME.layers"
    command=("$RENDER_CACHED" "$SCENE" --photons "$FOLDER/$NAME.photons" --resolution "$RESOLUTION"
        --mode "$MODE" --error "$ERROR" --seed "$SEED" --save-layers "$output")
    ;;
tile)
    output="$NAME-$SLURM_ARRAY_TASK_ID-of-$TILES.part.exr"
    command=("$RENDER_CACHED" "$SCENE" --photons "$FOLDER/$NAME.photons" --resolution "$RESOLUTION"
        --mode "$MODE" --error "$ERROR" --seed "$SEED"
        --tile "$SLURM_ARRAY_TASK_ID/$TILES" -o "$output")
    [ "$MODE" != adaptive ] || command+=(--from-layers "$NAME.layers")
    ;;
assemble)
    output="$NAME.exr"
    command=("$RENDER_CACHED" assemble "$NAME"-*-of-"$TILES".part.exr -o "$output")
    ;;
esac

if [ -e "$output" ]; then
    echo "$output is there"
    exit 0
fi
# Once more at once: shared disks have their moments.
"${command[@]}" || { sleep 2; [ -e "$output" ] || "${command[@]}"; } && exit 0
status=$?

# Another element may have written the same output meanwhile: whole, and with the same bytes.
[ -e "$output" ] && exit 0
if [ "${SLURM_RESTART_COUNT:-0}" -lt "$RETRIES" ]; then
    job="${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID}"
    echo "failed with $status; to be tried again, elsewhere perhaps"
    # This ends the script. Slurm waits for some two minutes before it starts the element again.
    scontrol requeue "${job:-$SLURM_JOB_ID}" && sleep 60
fi
exit "$status"
