#!/bin/sh
# The manual page, karst(1), from what the command says of itself: demos/desktop/manual.sh KARST > karst.1
set -eu
karst=$1

escape() { sed 's/\\/\\e/g; s/-/\\-/g; s/^\([.'"'"']\)/\\\&\1/'; }
version=$("$karst" --version | sed -n '1s/^karst //p')
commands=$("$karst" --help | sed -n 's/^  karst \([a-z]*\)  .*/\1/p')

cat << END
.TH KARST 1 "" "karst $version" "User Commands"
.SH NAME
karst \- ray\-casts procedural landscapes straight from a density function
.SH SYNOPSIS
.B karst
.I command
[\fIoptions\fR]
.br
.B karst help
.I command
.SH DESCRIPTION
Nothing is computed beforehand: rays ask for detail, producers evaluate it, and a cache keeps what was lately seen.
.PP
Data goes to stdout, talk to stderr.
END
for command in $commands; do
    echo ".SH KARST $(echo "$command" | tr '[:lower:]' '[:upper:]')"
    echo ".nf"
    "$karst" help "$command" | sed '/^Keys (H/,/^$/d; /^Worlds (or/,/^$/d; /^Exit code/,$d' | escape
    echo ".fi"
done
echo ".SH KEYS OF THE WINDOW"
"$karst" view --keys=manual
cat << 'END'
.SH EXIT STATUS
0 done, 1 failed or not settled, 2 wrong usage, 3 no usable device or display, 4 a world that does not compile or does
not exist, 5 other data that cannot be read, 75 a part of a job that SIGTERM ended and that is to be run again.
.SH ENVIRONMENT
.TP
.B KARST_CACHE_DIR
Karst's store, instead of ~/.cache/karst; off: without built programs
.TP
.B KARST_DATA_DIR
where worlds and paths that come with Karst are looked for first
.TP
.B KARST_VIEW_\fIOPTION\fR
an option of karst view, such as KARST_VIEW_FPS=60
.TP
.B KARST_VECTORS
avx2 or plain: kernels as on a CPU without AVX-512, or without AVX2
.TP
.B KARST_KERNEL_DIR
where kernel sources are read instead of from the library
.TP
.B KARST_TEST_FULL=1\fR, \fBKARST_TEST_QUICK=1
tests in full, or shorter; there are more, in the tests that read them
.TP
Other variables that begin with KARST_, and values that mean nothing, are warned of.
.TP
.B NO_COLOR
no colours in messages
.TP
.B POCL_CACHE_DIR
where PoCL keeps compiled kernels
.SH FILES
.TP
.B ~/.config/karst/config
options of karst view, a line each, such as \(lqfps = 60\(rq
.TP
.B ~/.local/state/karst/view.json
the window's place and size, and bookmarks
END
