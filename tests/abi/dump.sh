#!/bin/sh
# What the public headers declare, a line each, sorted: tests/abi/dump.sh CC. Types and enumerations with all that is in
# them, functions with their arguments, constants with their values.
set -eu
export LC_ALL=C
cc=${1:-cc}
scratch=$(mktemp) && trap 'rm -f "$scratch"' EXIT
echo '#include "karst/karst.h"' | $cc -std=c11 -Icore/include -E -x c - > "$scratch"
{
    awk '
        /^# [0-9]+ "/ { ours = $3 ~ /core\/include\/karst\//; next }
        !ours { next }
        {
            text = text " " $0
            depth += gsub(/\{/, "{") - gsub(/\}/, "}")
            if (depth == 0 && $0 ~ /;[[:space:]]*$/) {
                gsub(/[[:space:]]+/, " ", text)
                gsub(/__attribute__ ?\(\(.*\)\)/, "", text)
                gsub(/ ?; ?$/, ";", text)
                sub(/^ /, "", text)
                print text
                text = ""
            }
        }' "$scratch" | sed 's/ \([,;)]\)/\1/g'
    sed -n 's/^#define \(KARST_[A-Z0-9_]*\)  *\([^ /]*\).*/#define \1 \2/p' core/include/karst/*.h | grep -v '_H $'
} | sort -u
