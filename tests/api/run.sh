#!/bin/sh
# Each error that a public header documents is provoked by a test (tests/support/provoke.h), but for those that
# tests/api/not_provoked names, with a reason.
set -u
. tests/tap.sh
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

awk -f tests/api/documented.awk core/include/karst/*.h | sort -u > "$scratch/documented"
detail=$(grep ' NOTHING$' "$scratch/documented")
[ -s "$scratch/documented" ] && [ -z "$detail" ]
result "each function that takes a karst_error documents its errors ($(wc -l < "$scratch/documented") in all)"

# Macros may be broken over lines.
cat tests/api/*.c | tr '\n' ' ' | sed 's/PROVOKE/\nPROVOKE/g' | sed -nE \
    -e 's/^PROVOKE\((KARST_[A-Z_]+), +(karst_[a-z0-9_]+),.*/\2 \1/p' \
    -e 's/^PROVOKE_DATABASE\((KARST_[A-Z_]+), +SQLITE_[A-Z]+, +(karst_[a-z0-9_]+),.*/\2 \1/p' \
    -e 's/^PROVOKE_(MEMORY|DEVICE)\((karst_[a-z0-9_]+),.*/\2 KARST_FAILED/p' | sort -u > "$scratch/provoked"
sed '/^#/d; s/:.*//' tests/api/not_provoked | sort -u > "$scratch/excused"
detail=$(sort -u "$scratch/provoked" "$scratch/excused" | comm -23 "$scratch/documented" -)
[ -z "$detail" ]
result "each of them is provoked"
detail=$(comm -13 "$scratch/documented" "$scratch/excused"; comm -12 "$scratch/provoked" "$scratch/excused")
[ -z "$detail" ]
result "what is excused from that is documented, and not provoked after all"

# A header of which all is missing: the checks can fail.
printf '/* Does. Errors: KARST_USAGE (x), KARST_FAILED. */\nbool karst_a(int x, karst_error *error);\n/* As it is. */\nbool karst_b(karst_error *error);\n/* Errors: as karst_a. */\nbool karst_c(karst_error *error);\n' > "$scratch/a.h"
detail=$(awk -f tests/api/documented.awk "$scratch/a.h" | tr '\n' ';')
[ "$detail" = "karst_a KARST_USAGE;karst_a KARST_FAILED;karst_b NOTHING;karst_c KARST_USAGE;karst_c KARST_FAILED;" ]
result "errors are found in headers"
finish
