#!/bin/sh
# What Karst needs stands in three places, which must agree: .ci/install-dependencies, the README's line for Debian 12, and
# debian/control.
set -u
. tests/tap.sh
export LC_ALL=C
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

# What a build needs, and what tests need beside it.
awk '/^if \[ "\$group" = tests \]/ { tests = 1 } /^ *need [a-z0-9]/ { print tests ? "tests" : "build", $2 }' .ci/install-dependencies > "$scratch/need"
sed 's/.* //' "$scratch/need" | sort > "$scratch/script"
awk '/^    apt-get install/ { inside = 1 } inside { print } inside && !/\\$/ { exit }' README.md | tr -s ' \\' '\n\n' |
    grep -E '^[a-z0-9][a-z0-9.+-]+$' | grep -vxE 'apt-get|install' | sort > "$scratch/readme"
[ "$(wc -l < "$scratch/script")" -gt 30 ] && [ "$(wc -l < "$scratch/readme")" -gt 30 ]
result "both lists are found"
detail=$(uniq -d "$scratch/script"; uniq -d "$scratch/readme"; diff "$scratch/script" "$scratch/readme" | grep '^[<>]')
[ -z "$detail" ]
result "the README's line names what .ci/install-dependencies does"

# Every build for Debian has a compiler and make; what runs a program is no part of building it.
sed -n '/^Build-Depends:/,/^[A-Z]/{ s/^Build-Depends://; /^[A-Z]/d; p }' debian/control | tr ', ' '\n\n' | grep -E '^[a-z]' |
    sort > "$scratch/control"
sed -n 's/^build //p' "$scratch/need" | grep -vxE 'gcc|make|binutils|libc6-dev|pocl-opencl-icd|libegl-mesa0|libgl1-mesa-dri' | sort > "$scratch/build"
detail=$(comm -23 "$scratch/build" "$scratch/control")
[ -s "$scratch/build" ] && [ -z "$detail" ]
result "debian/control names what a build needs"
detail=$(grep -vxE 'debhelper-compat|dh-python' "$scratch/control" | comm -23 - "$scratch/script")
[ -z "$detail" ]
result "and nothing that .ci/install-dependencies does not know, but for what makes packages"

# What builds programs and what builds the library is found in the packages' own lines, too.
for package in libpng-dev libtiff-dev libjansson-dev libsqlite3-dev zlib1g-dev; do
    sed -n '/^Package: libkarst-dev/,/^$/p' debian/control | grep -q "$package" || detail="$detail $package"
done
[ -z "$detail" ] && [ "$(sed -n 's/^PKGS *:= *//p' Makefile)" = "libpng libtiff-4 jansson sqlite3 zlib" ]
result "libkarst-dev brings what karst.pc requires"
finish
