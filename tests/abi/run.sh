#!/bin/sh
# The library's face: what was promised is there (docs/API.md), nothing else leaves the library, headers stand alone, and
# each function has a test. make check calls it with KARST.
set -u
. tests/tap.sh
export LC_ALL=C
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
version=$(sed -n 's/^VERSION *:= *//p' Makefile)
young=0
case $version in 0.*) young=1 ;; esac
cc=${CC:-cc}

# ---- promises ----
sh tests/abi/dump.sh "$cc" > "$scratch/now"
[ "$(wc -l < "$scratch/now")" -gt 150 ]
result "declarations are found"
detail=$(awk -v young=$young -f tests/abi/compare.awk tests/abi/libkarst.abi "$scratch/now")
[ -z "$detail" ]
result "all that was promised is there as it was (if that is meant: make abi, and docs/API.md)"

# broken SED YOUNG: what is found where a header is changed so.
broken()
{
    sed "$1" "$scratch/now" > "$scratch/then"
    cmp -s "$scratch/now" "$scratch/then" && echo "no such line: $1" && return
    found=$(awk -v young="$2" -f tests/abi/compare.awk "$scratch/now" "$scratch/then")
    [ -n "$found" ] || echo "not found: $1"
}
detail=$(
    broken '/karst_version(/d' 1
    broken 's/karst_world_level(const karst_world \*world, double/&  */' 1
    broken 's/double yaw_deg; //' 1
    broken 's/double yaw_deg; double pitch_deg;/double pitch_deg; double yaw_deg;/' 1
    broken 's/KARST_NO_DEVICE = 3/KARST_NO_DEVICE = 7/' 1
    broken 's/ KARST_EDIT_BOX,//' 1
    broken 's/#define KARST_MAX_EDITS .*/#define KARST_MAX_EDITS 5/' 1
    broken 's/double yaw_deg; /& double roll_deg; /' 0
    broken 's/KARST_EDIT_SPHERE, /KARST_EDIT_CONE, &/' 0
)
[ -z "$detail" ]
result "what breaks programs is found"
detail=$(
    for change in 's/double yaw_deg; /& double roll_deg; /' 's/ KARST_EDIT_NOISE/ KARST_EDIT_NOISE, KARST_EDIT_CONE/' \
        's/const char \*karst_version(void);/&\nint karst_new(void);/'; do
        sed "$change" "$scratch/now" > "$scratch/then"
        cmp -s "$scratch/now" "$scratch/then" && echo "no such line: $change"
        awk -v young=1 -f tests/abi/compare.awk "$scratch/now" "$scratch/then"
    done
)
[ -z "$detail" ]
result "what does not is let pass"

# ---- symbols ----
grep -oh 'karst_[a-z0-9_]*(' core/include/karst/*.h | tr -d '(' | sort -u > "$scratch/declared"
sed -n 's/^[0-9].* //p' core/package/symbols | sort > "$scratch/listed"
detail=$(comm -13 "$scratch/declared" "$scratch/listed"; uniq -d "$scratch/listed")
[ -z "$detail" ]
result "each function that core/package/symbols lists is declared, and listed once"
shared=$(dirname "$KARST")/libkarst.so
if [ -e "$shared" ]; then
    nm -D --defined-only "$shared" | awk '$2 == "T" { print $3 }' | sort > "$scratch/exported"
    detail=$(sed 's/@@KARST_[0-9.]*$//' "$scratch/exported" | diff "$scratch/declared" -)
    [ -z "$detail" ]
    result "the shared library exports each of them, and nothing else"
    detail=$(grep -v '@@KARST_[0-9.]*$' "$scratch/exported"; sed -n 's/^\([0-9][^ ]*\) \(.*\)/\2@@KARST_\1/p' core/package/symbols |
        sort | comm -23 - "$scratch/exported")
detail=$(echo "$detail" | head -n 20)
    [ -z "$detail" ]
    result "with the versions that were promised"
else
    skip "exports" "no shared library in this configuration"
fi

# ---- headers ----
detail=$(
    for header in core/include/karst/*.h; do
        for language in "$cc -std=c17 -x c" "${CXX:-c++} -std=c++17 -x c++"; do
            echo "#include \"karst/${header##*/}\"" |
                $language -pedantic -Wall -Wextra -Werror -Icore/include -fsyntax-only - 2>&1
        done
    done
)
[ -z "$detail" ]
result "each header compiles alone as C17 and C++17 (as C11: make lint)"

# ---- tests ----
detail=$(find tests demos/command -name '*.[ch]' -path 'tests/*' -exec cat {} + | grep -oE 'karst_[a-z0-9_]+ ?\(?' | tr -d '( ' | sort -u |
    comm -23 "$scratch/declared" -)
[ -z "$detail" ]
result "each public function is called by a test in C"
finish
