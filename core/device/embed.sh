#!/bin/sh
# Prints a C file that holds the kernel sources named as arguments: karst_embedded_files[], ended by a NULL path.
# Question marks are escaped because C11 reads trigraphs inside strings.
set -eu
echo '/* Made by core/device/embed.sh. */'
echo '#include "core/device/embedded.h"'
echo 'const karst_embedded_file karst_embedded_files[] = {'
for f in "$@"; do
    printf '{"%s",\n' "$f"
    sed 's/\\/\\\\/g; s/"/\\"/g; s/?/\\?/g; s/^/"/; s/$/\\n"/' "$f"
    printf '\n""},\n'
done
echo '{0, 0}};'
