#!/usr/bin/env bash
# Starts a Slurm of one node, this machine, to try jobs on. As root, on Debian:
#
#   apt-get install slurm-wlm munge && one-node.sh
set -euo pipefail

conf="${SLURM_CONF:-/etc/slurm/slurm.conf}"
host="$(hostname -s)"
mkdir -p "$(dirname "$conf")" /var/lib/slurm/ctld /var/lib/slurm/d /run/munge
cat >"$conf" <<END
ClusterName=one
SlurmctldHost=$host
SlurmUser=root
StateSaveLocation=/var/lib/slurm/ctld
SlurmdSpoolDir=/var/lib/slurm/d
SlurmctldPidFile=/run/slurmctld.pid
SlurmdPidFile=/run/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
# Soon, not after minutes: what is tried here is short.
SchedulerParameters=bf_interval=1,sched_interval=1,sched_min_interval=0
ReturnToService=2
MessageTimeout=60
$(slurmd -C | head -n 1 | sed 's/ CPUs=/ State=UNKNOWN CPUs=/')
PartitionName=all Nodes=ALL Default=YES State=UP MaxTime=INFINITE
END

chown munge: /run/munge
pgrep -x munged >/dev/null || runuser -u munge -- munged
pgrep -x slurmctld >/dev/null || slurmctld
pgrep -x slurmd >/dev/null || slurmd
for _ in $(seq 60); do
    if sinfo --noheader --format=%t 2>/dev/null | grep -q '^\(idle\|mix\|alloc\)'; then
        exec sinfo
    fi
    sleep 1
done
echo "$0: the node doesn't come up; see $(scontrol show config | grep -i logfile)" >&2
exit 1
