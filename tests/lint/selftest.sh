#!/bin/sh
# Shows that each rule of the lint bites: a tidy little tree passes; with one bad snippet more it fails, by that rule.
set -u
. tests/tap.sh
lint="$PWD/tests/lint/run.sh"
tree=$(mktemp -d) || exit 1
trap 'rm -rf "$tree"' EXIT

mkdir -p "$tree/core/include/karst"
for folder in noise cache producers raycast reference demos tests; do
    mkdir "$tree/$folder"
done
echo 'int karst_good(void);' > "$tree/core/include/karst/good.h"
echo 'typedef int karst_private;' > "$tree/core/private.h"
echo '#define K 1' > "$tree/core/dialect.h"
printf '#include "core/dialect.h"\n' > "$tree/noise/good.clh"
printf '#include "core/private.h"\n#include "karst/good.h"\n' > "$tree/cache/cache.h"
printf '#include "cache/cache.h"\n#include "noise/good.clh"\n' > "$tree/producers/good.c"
echo '__kernel void k(void) {}' > "$tree/producers/good.cl"
printf '#include "cache/cache.h"\nvoid f(void) { clSetKernelArg(0, 0, 0, 0); }\n' > "$tree/raycast/good.c"
echo '__kernel void k(void) {}' > "$tree/raycast/good.cl"
printf '#include "raycast/cast.h"\n#include "producers/producer.h"\n' > "$tree/core/engine.c"
printf '#include <karst/good.h>\n#include "own.h"\n#include <stdio.h>\nint main(void) { return printf("data"); }\n' \
    > "$tree/demos/good.c"

detail=$(sh "$lint" "$tree" 2>&1)
result "a tidy tree passes"

# bites RULE NAME PATH TEXT: a file with this text (printf's escapes) makes the lint fail by this rule.
bites()
{
    printf "$4" > "$tree/$3"
    detail=$(sh "$lint" "$tree" 2>&1)
    status=$?
    rm "$tree/$3"
    [ $status -eq 1 ] && echo "$detail" | grep -q "^$3:[0-9]*: \[$1\]"
    result "$2"
}

bites tab "a tab" core/bad.c 'int x;\n\tint y;\n'
bites blanks "blanks at the end" core/bad.c 'int x; \n'
bites length "a line of 121 columns" core/bad.c "/* $(printf '%0115d' 0) */\n"
bites path "a path of one machine" core/bad.c '/* see /ho''me/someone/notes */\n'
bites unfinished "unfinished work" core/bad.c '/* TO''DO */\n'
bites size "900 lines" core/bad.c "$(yes 'int x;\n' | head -n 900 | tr -d '\n')"
bites arrow "core includes the cache" core/bad.c '#include "cache/cache.h"\n'
bites arrow "noise includes core" noise/bad.clh '#include "core/private.h"\n'
bites arrow "noise includes a public header" noise/bad.clh '#include "karst/good.h"\n'
bites arrow "cache includes producers" cache/bad.c '#include "producers/producer.h"\n'
bites arrow "producers include raycast" producers/bad.c '#include "raycast/cast.h"\n'
bites arrow "producers include the cache's inside" producers/bad.c '#include "cache/lists.h"\n'
bites arrow "raycast includes producers" raycast/bad.cl '#include "producers/producer.h"\n'
bites arrow "raycast includes the engine" raycast/bad.c '#include "core/engine_private.h"\n'
bites arrow "raycast includes the reference" raycast/bad.c '#include "reference/trace.h"\n'
bites arrow "the reference includes the cache" reference/bad.c '#include "cache/cache.h"\n'
bites arrow "a demo includes a private header" demos/bad.c '#include "core/private.h"\n'
bites arrow "a public header includes a private one" core/include/karst/bad.h '#include "core/private.h"\n'
bites arrow "the library includes a demo" cache/bad.c '#include "demos/command.h"\n'
bites quartet "a kernel that nothing launches" cache/bad.cl '__kernel void k(void) {}\n'
bites arguments "arguments set outside a quartet" core/bad.c 'void f(void) { clSetKernelArg(0, 0, 0, 0); }\n'
bites arguments "arguments set by macro outside a quartet" core/engine_bad.c 'int i = KARST_ARGUMENTS(k, e, {4, 0});\n'
bites printf "printf in the library" cache/bad.c 'void f(void) { printf("x"); }\n'
bites printf "stderr in the library" cache/bad.c 'void f(void) { fprintf(stderr, "x"); }\n'
bites printf "printf in a kernel" raycast/good_shared.clh 'void f() { printf("x"); }\n'
bites alone "a public header that needs another" core/include/karst/bad.h 'int karst_bad(size_t n);\n'
bites alone "a public header that is no C++" core/include/karst/bad.h 'int karst_bad(int class);\n'
bites alone "a private header that needs another" cache/bad.h 'int bad(size_t n);\n'
finish
