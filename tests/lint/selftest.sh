#!/bin/sh
# Shows that each rule of the lint bites: a tidy little tree passes; with one bad snippet more it fails, by that rule.
set -u
. tests/tap.sh
lint="$PWD/tests/lint/run.sh"
tree=$(mktemp -d) || exit 1
trap 'rm -rf "$tree"' EXIT

for folder in core/include/karst core/base core/device core/engine noise cache producers/steps producers/density raycast/cast \
    raycast/light reference demos tests; do
    mkdir -p "$tree/$folder"
done
echo 'int karst_good(void);' > "$tree/core/include/karst/good.h"
echo 'typedef int karst_private;' > "$tree/core/base/private.h"
echo '#define K 1' > "$tree/core/device/dialect.h"
printf '#include "core/device/dialect.h"\n' > "$tree/noise/good.clh"
printf '#include "core/base/private.h"\n#include "karst/good.h"\n' > "$tree/cache/cache.h"
printf '#include "cache/cache.h"\n#include "noise/good.clh"\n' > "$tree/producers/steps/good.c"
echo '__kernel void k(void) {}' > "$tree/producers/steps/good.cl"
printf '#include "cache/cache.h"\nvoid f(void) { clSetKernelArg(0, 0, 0, 0); }\n' > "$tree/raycast/cast/good.c"
echo '__kernel void k(void) {}' > "$tree/raycast/cast/good.cl"
printf '#include "raycast/cast/cast.h"\n#include "producers/producer.h"\n' > "$tree/core/engine/engine.c"
printf '#include <karst/good.h>\n#include "own.h"\n#include <stdio.h>\nint main(void) { return printf("data"); }\n' \
    > "$tree/demos/good.c"

detail=$(sh "$lint" "$tree" 2>&1)
result "a tidy tree passes"

# bites RULE NAME PATH TEXT: a file with this text (printf's escapes) makes the lint fail by this rule.
bites()
{
    mkdir -p "$tree/$(dirname "$3")"
    printf "$4" > "$tree/$3"
    detail=$(sh "$lint" "$tree" 2>&1)
    status=$?
    rm "$tree/$3"
    [ $status -eq 1 ] && echo "$detail" | grep -q "^$3:[0-9]*: \[$1\]"
    result "$2"
}

bites tab "a tab" core/base/bad.c 'int x;\n\tint y;\n'
bites blanks "blanks at the end" core/base/bad.c 'int x; \n'
bites length "a line of 121 columns" core/base/bad.c "/* $(printf '%0115d' 0) */\n"
bites path "a path of one machine" core/base/bad.c '/* see /ho''me/someone/notes */\n'
bites unfinished "unfinished work" core/base/bad.c '/* TO''DO */\n'
bites variadic "a macro of a kernel with any number of arguments" noise/bad.clh '#define BAD(a, ...) f(a, __VA_ARGS__)\n'
bites size "701 lines" core/base/bad.c "$(yes 'int x;\n' | head -n 701 | tr -d '\n')"
bites long "a function of 151 lines" core/base/bad.c "int bad(void)\n{\n$(yes '    x();\n' | head -n 148 | tr -d '\n')}\n"
bites parameters "eleven parameters" core/base/bad.c \
    'int bad(int a, int b, int c, int d, int e, int (*f)(int, int),\n        int g, int h, int i, int j, int k)\n{\n    return a;\n}\n'
echo 'int karst_first(int x) { return x ? karst_last(x - 1) : 0; }' > "$tree/core/base/first.c"
bites circle "calls that go round" core/base/bad.c 'int karst_last(int x)\n{\n    return karst_first(x);\n}\n'
printf 'const char *karst_first(void) { return "karst_last"; }\n/* karst_last */\n' > "$tree/core/base/first.c"
printf 'int karst_last(int x) { return karst_first() != 0; }\n' > "$tree/core/base/last.c"
detail=$(sh "$lint" "$tree" 2>&1)
result "names in texts and comments are no calls"
rm "$tree/core/base/first.c" "$tree/core/base/last.c"
echo '#include "core/base/bad.h"' > "$tree/core/base/first.h"
bites circle "includes that go round" core/base/bad.h '#include "core/base/first.h"\n'
mkdir -p "$tree/tests/lint"
echo 'circle core/base/bad.h core/base/first.h' > "$tree/tests/lint/exceeding"
printf '#ifndef BAD_H\n#define BAD_H\n#include "core/base/first.h"\n#endif\n' > "$tree/core/base/bad.h"
detail=$(sh "$lint" "$tree" 2>&1)
result "a circle that is listed passes"
rm "$tree/core/base/bad.h" "$tree/core/base/first.h"
bites list "a circle in the list that is gone" tests/lint/exceeding 'circle core/base/bad.h core/base/first.h\n'
bites list "a long function in the list that is short" tests/lint/exceeding 'function core/base/private.h karst_private\n'
bites arrow "core includes the cache" core/base/bad.c '#include "cache/cache.h"\n'
bites arrow "the ground floor includes what stands on it" core/base/bad.c '#include "core/device/dialect.h"\n'
bites arrow "casting includes light" raycast/cast/bad.c '#include "raycast/light/shade.h"\n'
bites arrow "a room that the table lacks" core/cellar/bad.c '#include "core/base/private.h"\n'
bites arrow "noise includes core" noise/bad.clh '#include "core/base/private.h"\n'
bites arrow "noise includes a public header" noise/bad.clh '#include "karst/good.h"\n'
bites arrow "cache includes producers" cache/bad.c '#include "producers/producer.h"\n'
bites arrow "producers include raycast" producers/steps/bad.c '#include "raycast/cast/cast.h"\n'
bites arrow "producers include the cache's inside" producers/steps/bad.c '#include "cache/lists.h"\n'
bites arrow "raycast includes producers" raycast/cast/bad.cl '#include "producers/producer.h"\n'
bites arrow "raycast includes the engine" raycast/cast/bad.c '#include "core/engine/private.h"\n'
bites arrow "raycast includes the reference" raycast/cast/bad.c '#include "reference/trace.h"\n'
bites arrow "the reference includes the cache" reference/bad.c '#include "cache/cache.h"\n'
bites arrow "a demo includes a private header" demos/bad.c '#include "core/base/private.h"\n'
bites arrow "a public header includes a private one" core/include/karst/bad.h '#include "core/base/private.h"\n'
bites arrow "the library includes a demo" cache/bad.c '#include "demos/command/command.h"\n'
bites quartet "a kernel that nothing launches" cache/bad.cl '__kernel void k(void) {}\n'
bites arguments "arguments set outside a quartet" core/base/bad.c 'void f(void) { clSetKernelArg(0, 0, 0, 0); }\n'
bites arguments "arguments set by macro outside a quartet" core/engine/bad.c 'int i = KARST_ARGUMENTS(k, e, {4, 0});\n'
bites printf "printf in the library" cache/bad.c 'void f(void) { printf("x"); }\n'
bites printf "stderr in the library" cache/bad.c 'void f(void) { fprintf(stderr, "x"); }\n'
bites printf "printf in a kernel" raycast/cast/good_shared.clh 'void f() { printf("x"); }\n'
bites alone "a public header that needs another" core/include/karst/bad.h 'int karst_bad(size_t n);\n'
bites alone "a public header that is no C++" core/include/karst/bad.h 'int karst_bad(int class);\n'
bites alone "a private header that needs another" cache/bad.h 'int bad(size_t n);\n'
finish
