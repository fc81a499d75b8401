#!/bin/sh
# A newcomer's walk: docs/TUTORIAL.md and the README's first commands in a bare chroot of Debian 12, as root, each command
# as it is written there, at its full size. For root, with network; takes some twenty minutes, and is no part of make
# check:
#   sh tests/packages/newcomer.sh [SCRATCH]
# KARST_MIRROR names another mirror of Debian, KARST_CHROOT a tar of a bare chroot that is there already.
set -u
# What is mounted is mounted for this script alone, and goes with it.
if [ "$(id -u)" = 0 ] && [ -z "${KARST_UNSHARED:-}" ] && unshare --mount true 2> /dev/null; then
    KARST_UNSHARED=yes exec unshare --mount --propagation private sh "$0" "$@"
fi
. tests/tap.sh
scratch=${1:-}
[ -n "$scratch" ] || scratch=$(mktemp -d) || exit 1
mkdir -p "$scratch" && scratch=$(cd "$scratch" && pwd) || exit 1
mirror=${KARST_MIRROR:-http://deb.debian.org/debian}
if ! command -v debootstrap > /dev/null || [ -z "${KARST_UNSHARED:-}" ]; then
    skip "a newcomer's walk" "only root may make a chroot, with debootstrap and mounts of its own"
    finish
fi

chroot=$(mktemp -d "$scratch/newcomer-XXXXXX") && chmod 755 "$chroot" || exit 1
remove_chroot()
{
    umount "$chroot/proc" "$chroot/sys" 2> /dev/null
    if grep -q " $chroot[/ ]" /proc/mounts; then
        echo "# $chroot is left: something is mounted in it" >&2
    else
        rm -rf --one-file-system "$chroot"
    fi
}
trap remove_chroot EXIT
trap 'exit 143' INT TERM HUP
if [ -n "${KARST_CHROOT:-}" ]; then
    detail=$(tar -xf "$KARST_CHROOT" -C "$chroot" 2>&1)
else
    detail=$(debootstrap --variant=minbase bookworm "$chroot" "$mirror" 2>&1 | tail -n 5)
fi
[ -x "$chroot/bin/sh" ]
result "a bare chroot"
[ -x "$chroot/bin/sh" ] || finish
mount -t proc proc "$chroot/proc" && mount -t sysfs -o ro sysfs "$chroot/sys"
cp /etc/resolv.conf "$chroot/etc/" 2> /dev/null
echo "deb $mirror bookworm main" > "$chroot/etc/apt/sources.list"
[ -z "${KARST_APT_CONF:-}" ] || cp "$KARST_APT_CONF" "$chroot/etc/apt/apt.conf.d/"
mkdir -p "$chroot/srv/karst"
tar -cf - --exclude=./build . | tar -xf - -C "$chroot/srv/karst"

# step COMMAND: in the folder of the sources, with the page's own PATH, as one types it.
path=/usr/sbin:/usr/bin:/sbin:/bin
step()
{
    detail=$(chroot "$chroot" env -i PATH="$path" HOME=/root DEBIAN_FRONTEND=noninteractive sh -c "cd /srv/karst && $1" 2>&1)
    step_status=$?
    detail="exit $step_status: $(echo "$detail" | tail -n 12)"
    return $step_status
}
# walks PAGE COMMAND: the page has the line, and it works.
walks()
{
    grep -qF "$2" "$1" || { detail="$1 has no such line"; false; result "$2"; return; }
    step "$2"
    result "$2"
}
# shows PICTURE: it is there, and no plain colour.
shows()
{
    [ -s "$chroot/srv/karst/$1" ] && [ "$(wc -c < "$chroot/srv/karst/$1")" -gt 20000 ]
    result "$1 is a picture"
}

# ---- the README ----
step "apt-get -q update && apt-get -q -y install make"
result "the README's word on make"
walks README.md "make demo"
shows build/demo.png
walks README.md "build/karst render hills -o hills.png --size 1920x1080"
shows hills.png
walks README.md "echo 'float density(vec3 p) { return 300.0 * fbm(p / 1024.0, 8) - p.y; }' > mine.karst"
walks README.md "build/karst render mine.karst -o mine.png"
shows mine.png

# ---- the tutorial ----
page=docs/TUTORIAL.md
walks $page "make demo"
path="/srv/karst/build:$path"
awk '/^    / { if (!inside) num++; inside = 1; print substr($0, 5) > sprintf("'"$scratch"'/block-%02d", num); next }
    /^$/ && inside { next }
    { inside = 0 }' $page
holding() { grep -lF -e "$1" "$scratch"/block-* | head -n 1; }
write() { cp "$1" "$chroot/srv/karst/first.karst"; }
walks $page "karst render hills -o hills.png"
write "$(holding 'float height = 200.0')"
walks $page "karst render first.karst -o first.png"
shows first.png
walks $page "karst check first.karst"
write "$(holding ridged)"
walks $page "karst render first.karst -o first.png"
{ cat "$(holding '"params"')"; sed 's/200\.0/relief/' "$(holding ridged)"; } > "$scratch/next" && write "$scratch/next"
walks $page "karst render first.karst --param relief=400 -o high.png"
shows high.png
awk -v caves="$(holding 'float caves')" '/return height - p.y;/ { while ((getline line < caves) > 0) print line; next } { print }' "$scratch/next" > "$scratch/caves"
write "$scratch/caves"
walks $page "karst render first.karst -o caves.png"
shows caves.png
walks $page "karst render first.karst --camera 1e12,300,-1e12,90,-10 -o far.png"
shows far.png
cp "$chroot/srv/karst"/*.png "$scratch/" 2> /dev/null
finish
