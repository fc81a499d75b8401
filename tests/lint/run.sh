#!/bin/sh
# Checks layout, includes and style: tests/lint/run.sh ROOT. Prints path:line: [rule] what; exit 1 if there is anything.
# tests/lint/selftest.sh shows that each rule bites.
set -u
root=${1:-.}
here=$(cd "$(dirname "$0")" && pwd)
cd "$root" || exit 2
export LC_ALL=C.UTF-8

scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT
complaints="$scratch/complaints"
: > "$complaints"

# Builds and pictures are not ours to judge, nor are world files that tests take from the wild.
find . -type f -not -path './.git/*' -not -path './build*' -not -name '*.png' | sed 's|^\./||' |
    grep -vE '^tests/[^/]*/(pasted|hostile)/' | sort > "$scratch/all"
# list PATTERN: files whose path matches, one a line.
list() { grep -E "$1" "$scratch/all"; }
list '\.(c|h|cl|clh)$' > "$scratch/code"
list '\.sh$|^\.ci/' > "$scratch/shell"
list '^(core|noise|producers|cache|raycast|reference)/.*\.(c|h|cl|clh)$' > "$scratch/library"
list '(^|/)Makefile$|\.(c|h|cl|clh|sh|mk|md|karst)$|^\.ci/' > "$scratch/text"
grep -vE '\.(md|karst)$' "$scratch/text" > "$scratch/written"

# complain RULE WHAT: reads path:line:text lines.
complain() { sed "s|^\([^:]*:[0-9]*\):.*|\1: [$1] $2|" >> "$complaints"; }
# search LIST PATTERN: path:line:text of every match.
search() { xargs -r grep -nHE -e "$2" < "$scratch/$1"; }
tab=$(printf '\t')

# ---- text ----
grep -vE '(^|/)Makefile$|\.mk$' "$scratch/text" > "$scratch/untabbed"
search untabbed "$tab" | complain tab "a tab: indent with 4 spaces"
search text '[[:space:]]+$' | complain blanks "blanks at the end of the line"
search code '^.{121,}' | complain length "longer than 120 columns"
# A command is worse to read when it is broken up.
search written '^.{241,}' | complain length "longer than 240 columns"
search text '(^|[^A-Za-z0-9._-])/(work|home|root|Users)/' | complain path "a path of one machine"
search code '(^|[^A-Za-z_])(TO''DO|FIX''ME|X''XX|HA''CK)([^A-Za-z_]|$)' |
    complain unfinished "finish it, or say in plain words why it is right"
# ---- floors and arrows ----
xargs -r grep -nHE '^[[:space:]]*#[[:space:]]*include' < "$scratch/code" | awk -f "$here/arrows.awk" "$here/rooms" - >> "$complaints"

# ---- limits and circles: of what calls what the texts tell enough, so nothing need be built ----
xargs -r awk -f "$here/functions.awk" < "$scratch/code" > "$scratch/functions"
exceeding=tests/lint/exceeding
[ -e "$exceeding" ] || exceeding=
{
    grep '^function' "$scratch/functions"
    xargs -r wc -l < "$scratch/code" | awk '$2 != "total" { print "file", $2, $1 }'
    grep -vE '^(defines|uses) tests/' "$scratch/functions" | awk -f "$here/calls.awk" | awk -f "$here/circles.awk" |
        sed 's/^/circle calls /'
    xargs -r grep -nHE '^[[:space:]]*#[[:space:]]*include[[:space:]]*"' < "$scratch/code" | awk -f "$here/includes.awk" "$scratch/code" - |
        awk -f "$here/circles.awk" | sed 's/^/circle includes /'
} | awk -f "$here/limits.awk" $exceeding - >> "$complaints"

# ---- kernels ----
list '\.cl$' | grep -v '^tests/' | while read -r kernel; do
    [ -e "${kernel%.cl}.c" ] || echo "$kernel:1: [quartet] no ${kernel%.cl}.c launches it" >> "$complaints"
done
# Where setting arguments is defined rather than used.
grep -vE '^core/device/(context\.h|launch\.c|program\.c)$' "$scratch/code" | grep -v '^tests/' | while read -r file; do
    [ -e "${file%.c}.cl" ] && [ "${file%.c}" != "$file" ] || echo "$file"
done > "$scratch/no_kernel"
search no_kernel '(clSetKernelArg|karst_arguments|KARST_ARGUMENTS)[[:space:]]*\(' |
    complain arguments "only the .c of a kernel's quartet sets its arguments"

list '\.(cl|clh)$|_shared\.h$' > "$scratch/device"
search device '^[[:space:]]*#[[:space:]]*define[[:space:]]+[A-Za-z_0-9]+\([^)]*\.\.\.' |
    complain variadic "a macro with any number of arguments: OpenCL C has none, and GPU compilers refuse it"

# ---- the library keeps quiet ----
search library '(^|[^A-Za-z0-9_])(v?printf|puts|putchar|perror)[[:space:]]*\(' |
    complain printf "the library talks through karst_log only"
search library '(printf|fputs|fputc|putc|fwrite|fflush)[[:space:]]*\(([^;]*[^A-Za-z_])?(stdout|stderr)[^A-Za-z_]' |
    complain printf "the library talks through karst_log only"

# ---- headers compile alone ----
compiles()
{
    file=$1
    shift
    echo "#include \"$file\"" | "$@" -I. -Icore/include -Wall -Wextra -Werror -fsyntax-only - 2> "$scratch/why" ||
        echo "$file:1: [alone] does not compile alone with $1 $2: $(grep -m 1 error "$scratch/why")" >> "$complaints"
}
list '^core/include/karst/.*\.h$' | while read -r header; do
    compiles "$header" "${CC:-cc}" -std=c11 -pedantic -x c
    compiles "$header" "${CXX:-c++}" -std=c++11 -pedantic -x c++
done
list '^(core|noise|producers|cache|raycast|reference|demos|tests)/.*\.h$' | grep -v '^core/include/' | while read -r header; do
    compiles "$header" "${CC:-cc}" -std=c11 -D_GNU_SOURCE -x c
done

sort -u -t : -k 1,1 -k 2,2n -k 3 "$complaints"
num=$(sort -u "$complaints" | wc -l)
echo "lint: $(wc -l < "$scratch/code") files of code, $num complaints"
[ "$num" -eq 0 ]
