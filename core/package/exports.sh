#!/bin/sh
# The version script of the shared library: core/package/exports.sh core/package/symbols HEADER...
# Only what the public headers declare leaves the library. `symbols` says since which version each function is there
# ("0.1 karst_version"); a function that it does not name yet belongs to the newest.
set -eu
symbols=$1
shift
grep -oh 'karst_[a-z0-9_]*(' "$@" | tr -d '(' | sort -u | awk -v symbols="$symbols" '
    BEGIN {
        while ((getline line < symbols) > 0)
            if (line !~ /^#/ && split(line, part, " ") == 2) {
                since[part[2]] = part[1]
                if (part[1] != newest)
                    order[num++] = newest = part[1]
            }
    }
    { names[$1 in since ? since[$1] : newest] = names[$1 in since ? since[$1] : newest] "    " $1 ";\n" }
    END {
        for (i = 0; i < num; i++)
            printf "KARST_%s {\nglobal:\n%s%s}%s;\n", order[i], names[order[i]], i ? "" : "local:\n    *;\n",
                i ? " KARST_" order[i - 1] : ""
    }'
