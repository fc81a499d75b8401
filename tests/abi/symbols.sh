#!/bin/sh
# Adds public functions that core/package/symbols does not name, as of this version: tests/abi/symbols.sh 0.1
set -eu
export LC_ALL=C
list=core/package/symbols
grep -oh 'karst_[a-z0-9_]*(' core/include/karst/*.h | tr -d '(' | sort -u | while read -r name; do
    grep -q " $name\$" "$list" || echo "$1 $name"
done > "$list.tmp"
# Those of one version together, in order.
{ sed -n '1p' "$list"; { sed 1d "$list"; cat "$list.tmp"; } | sort -t ' ' -k 1,1V -k 2; } > "$list.new"
mv "$list.new" "$list" && rm -f "$list.tmp"
