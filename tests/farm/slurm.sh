#!/bin/sh
# The script of docs/FARM.md under a real Slurm: one node, an array of jobs, one of which is told to end early and goes on.
# Starts its own munged, slurmctld and slurmd on ports of its own, and ends them. Needs root and Debian's slurmctld,
# slurmd, slurm-client and munge; says so where one lacks. $KARST is the program. FRAMES=n and SIZE=WxH make it longer.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
page="$PWD/docs/FARM.md"
export KARST_DATA_DIR="${KARST_DATA_DIR:-$PWD/demos}"
for program in munged slurmctld slurmd sbatch scontrol squeue; do
    if ! PATH="$PATH:/usr/sbin" command -v $program > /dev/null 2>&1; then
        skip "Slurm" "no $program: apt-get install slurmctld slurmd slurm-client munge"
        finish
    fi
done
if [ "$(id -u)" -ne 0 ]; then
    skip "Slurm" "only root may start it"
    finish
fi
PATH="$PATH:/usr/sbin"
scratch=$(mktemp -d /tmp/karst-slurm-XXXXXX) || exit 1
end()
{
    kill $(cat "$scratch"/*.pid 2> /dev/null) 2> /dev/null
    sleep 1
    rm -rf "$scratch"
}
trap end EXIT
chmod 755 "$scratch"
cd "$scratch" || exit 1
mkdir spool state frames whole

# ---- a Slurm of one node ----
node=$(hostname -s) cores=$(nproc)
dd if=/dev/urandom of=munge.key bs=1024 count=1 2> /dev/null && chmod 400 munge.key
munged --force --socket "$scratch/munge.socket" --key-file "$scratch/munge.key" --pid-file "$scratch/munged.pid" \
    --log-file "$scratch/munged.log" --seed-file "$scratch/munge.seed" > munged.out 2>&1
cat > slurm.conf << END
ClusterName=karst
SlurmctldHost=$node(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$scratch/munge.socket
CredType=cred/munge
SlurmctldPort=26817
SlurmdPort=26818
SlurmctldPidFile=$scratch/slurmctld.pid
SlurmdPidFile=$scratch/slurmd.pid
SlurmctldLogFile=$scratch/slurmctld.log
SlurmdLogFile=$scratch/slurmd.log
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
SlurmdParameters=config_overrides
NodeName=$node NodeAddr=127.0.0.1 CPUs=$cores State=UNKNOWN
PartitionName=all Nodes=$node Default=YES MaxTime=INFINITE State=UP
END
export SLURM_CONF="$scratch/slurm.conf"
slurmctld > slurmctld.out 2>&1
slurmd > slurmd.out 2>&1
waited=0
until sinfo -h -o %t 2> /dev/null | grep -q '^idle'; do
    waited=$((waited + 1))
    [ $waited -le 60 ] || break
    sleep 1
done
detail=$(sinfo 2>&1; tail -n 3 slurmctld.log slurmd.log 2>&1)
sinfo -h -o %t 2> /dev/null | grep -q '^idle'
result "a Slurm of one node starts"

# ---- the page's script, with one core a task ----
awk '/^## Slurm/ { at = 1 } at && /^```bash/ { on = 1; next } /^```/ { on = 0 } on' "$page" |
    sed 's/--cpus-per-task=4/--cpus-per-task=1/; s/--time=02:00:00/--time=00:30:00/' > farm.sbatch
frames=${FRAMES:-24} size=${SIZE:-96x64}
fly="hills --path low-flight --frames $frames --size $size --pool 64 --detail 2 --display none -q"
"$karst" render $fly -o frames/%05d.exr --jobs 6 > jobs.txt 2> jobs.err
sed -i "s|^karst |'$karst' |" jobs.txt
detail=$(cat jobs.err; head -n 2 jobs.txt)
[ "$(wc -l < jobs.txt)" -eq 6 ] && [ -s farm.sbatch ]
result "six commands and the page's script"
job=$(sbatch --parsable --array=1-6 farm.sbatch 2> sbatch.err)
detail=$(cat sbatch.err)
[ -n "$job" ]
result "Slurm takes the array"
# The first task that runs is asked to end, as one that runs out of time is: it goes back into the queue.
waited=0 asked=
while squeue -h -j "$job" 2> /dev/null | grep -q .; do
    if [ -z "$asked" ] && running=$(squeue -h -t RUNNING -j "$job" -o %A 2> /dev/null | head -n 1) && [ -n "$running" ]; then
        sleep 1
        scancel --batch --signal=TERM "$running" 2> /dev/null && asked=$running
    fi
    waited=$((waited + 1))
    [ $waited -le "${WAIT_S:-1500}" ] || break
    sleep 1
done
detail=$(squeue 2>&1; tail -n 5 slurm-*.out 2>&1)
! squeue -h -j "$job" 2> /dev/null | grep -q .
result "the array ends"
detail=$("$karst" verify frames/manifest.json 2>&1; grep -iE 'requeuing|sigterm' slurmctld.log | tail -n 3)
"$karst" verify frames/manifest.json > verify.out 2>&1
result "every picture is there and right"
grep -qi "requeuing" slurmctld.log
result "a task that was asked to end went back into the queue"
"$karst" render $fly -o whole/%05d.exr > whole.out 2>&1
detail=$(tail -n 3 whole.out; ls whole | wc -l; ls frames/*.exr | wc -l)
same=yes
for picture in whole/*.exr; do
    cmp -s "$picture" "frames/${picture##*/}" || same="no: ${picture##*/}"
done
detail="$detail; $same"
[ "$same" = yes ] && [ "$(ls whole | wc -l)" -eq "$frames" ]
result "they are the bytes of a single process"
finish
