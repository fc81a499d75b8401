#!/bin/sh
# Builds the Debian packages, looks at them with lintian, installs them in a bare chroot, uses and removes them. For root
# on Debian 12, with network; takes some ten minutes, and is no part of make check:
#   sh tests/packages/run.sh [SCRATCH]
# KARST_MIRROR names another mirror of Debian; KARST_DEBS a folder of packages that are there already.
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
debs=${KARST_DEBS:-$scratch/debs}

for command in dpkg-buildpackage dh lintian debootstrap; do
    command -v $command > /dev/null && continue
    skip "Debian packages" "no $command (apt-get install build-essential debhelper dh-python lintian debootstrap)"
    finish
done
if [ -z "${KARST_UNSHARED:-}" ]; then
    skip "Debian packages" "only root may make a chroot, with mounts of its own"
    finish
fi

# ---- building ----
if [ -z "${KARST_DEBS:-}" ]; then
    rm -rf "$scratch/karst" "$debs" && mkdir -p "$scratch/karst" "$debs"
    tar -cf - --exclude=./.git --exclude=./build . | tar -xf - -C "$scratch/karst"
    (cd "$scratch/karst" && unset MAKEFLAGS MFLAGS CFLAGS && dpkg-buildpackage -b -us -uc -j"$(nproc)") > "$scratch/build.log" 2>&1
    detail=$(tail -n 30 "$scratch/build.log")
    mv "$scratch"/*.deb "$scratch"/*.changes "$debs" 2> /dev/null
    [ "$(ls "$debs" | grep -cE '^(libkarst0|libkarst-dev|karst|python3-karst)_.*\.deb$')" = 4 ]
    result "dpkg-buildpackage makes four packages"
fi
detail=$(lintian --fail-on error "$debs"/*.changes 2>&1 | grep '^E:')
[ -z "$detail" ]
result "lintian finds no error"
detail=$(dpkg-deb -c "$debs"/libkarst0_*.deb | awk '$1 ~ /^[-l]/ { print $6 }' | grep -vE '^\./usr/(lib/[^/]*/libkarst\.so\.0|share/doc/libkarst0/.*)$')
[ -z "$detail" ]
result "libkarst0 holds the library alone, so that later ones go beside it"

# ---- a bare chroot ----
# A folder of this run alone. It is removed only once nothing is mounted in it, and never across file systems.
chroot=$(mktemp -d "$scratch/chroot-XXXXXX") && chmod 755 "$chroot" || exit 1
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
detail=$(debootstrap --variant=minbase bookworm "$chroot" "$mirror" 2>&1 | tail -n 5)
[ -x "$chroot/bin/sh" ]
result "debootstrap"
[ -x "$chroot/bin/sh" ] || finish
mount -t proc proc "$chroot/proc" && mount -t sysfs -o ro sysfs "$chroot/sys"
cp /etc/resolv.conf "$chroot/etc/" 2> /dev/null
echo "deb $mirror bookworm main" > "$chroot/etc/apt/sources.list"
[ -z "${KARST_APT_CONF:-}" ] || cp "$KARST_APT_CONF" "$chroot/etc/apt/apt.conf.d/"
mkdir "$chroot/debs" && cp "$debs"/*.deb "$chroot/debs"
inside() { chroot "$chroot" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive sh -c "$1"; }
inside 'find / -xdev -path /proc -prune -o -path /sys -prune -o -path "*karst*" -print' | sort > "$scratch/before"
detail=$(inside 'apt-get -q update && apt-get -q -y install /debs/karst_*.deb /debs/libkarst0_*.deb /debs/python3-karst_*.deb' 2>&1 | tail -n 20)
inside 'dpkg -s karst libkarst0 python3-karst' > /dev/null 2>&1
result "apt-get install, with what it installs by default"
detail=$(inside 'cd /root && karst render hills -q --size 160x120' 2>&1)
[ -s "$chroot/root/out.png" ]
result "karst render hills"
detail=$(inside "cd /root && python3 -c \"import karst; karst.World('hills').render(size=(160, 120)).save('a.png')\"" 2>&1)
cmp -s "$chroot/root/out.png" "$chroot/root/a.png"
result "the same picture from Python"
detail=$(inside 'man -w karst || ls -l /usr/share/man/man1/karst.1.gz; test -s /usr/share/bash-completion/completions/karst' 2>&1)
result "manual and completions are there"

# ---- a program ----
detail=$(inside 'apt-get -q -y install --no-install-recommends gcc libc6-dev pkg-config /debs/libkarst-dev_*.deb' 2>&1 | tail -n 20)
detail=$(inside 'cd /root && cp /usr/share/doc/libkarst-dev/examples/minimal.c . && cc minimal.c $(pkg-config --cflags --libs karst) -o minimal && ./minimal hills minimal.png' 2>&1)
[ -s "$chroot/root/minimal.png" ]
result "demos/minimal.c builds against libkarst-dev, and runs"

# ---- gone without a trace ----
inside 'rm -rf "$HOME"/* "$HOME"/.cache; apt-get -q -y purge karst libkarst0 libkarst-dev python3-karst' > "$scratch/purge.log" 2>&1
rm -rf "$chroot/var/cache/apt" "$chroot/debs"
inside 'find / -xdev -path /proc -prune -o -path /sys -prune -o -path "*karst*" -print' | grep -v '^/debs' | sort > "$scratch/after"
detail=$(comm -13 "$scratch/before" "$scratch/after")
[ -z "$detail" ]
result "purge leaves nothing"
finish
