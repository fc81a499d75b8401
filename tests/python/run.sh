#!/bin/sh
# pip install . into a fresh environment, without network, and the module's tests there. make check-python calls it with
# KARST, LIBRARY and SHARED (the command, the static and the shared library), SCRATCH (a folder), CC and PYTHON.
set -u
. tests/tap.sh
python=${PYTHON:-}
[ -z "$python" ] && for candidate in /usr/bin/python3 python3; do
    $candidate -c 'import numpy' 2> /dev/null && python=$candidate && break
done
python=${python:-python3}

# lacks: what Python has not, if anything.
lacks()
{
    command -v "$python" > /dev/null || { echo "Python"; return; }
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11"; return; }
    for module in numpy pytest setuptools wheel ensurepip; do
        "$python" -c "import $module" 2> /dev/null || { echo "$python's $module"; return; }
    done
    header=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h
    [ -e "$header" ] || echo "$header"
}
missing=$(lacks)
if [ -n "$missing" ]; then
    skip "the Python module" "no $missing (.ci/install-dependencies tests)"
    finish
fi

unset MAKEFLAGS MFLAGS MAKELEVEL
rm -rf "$SCRATCH" && mkdir -p "$SCRATCH" || exit 1
detail=$("$python" -m venv --system-site-packages "$SCRATCH/venv" 2>&1)
result "a fresh environment"
detail=$(KARST_LIBRARY=$LIBRARY "$SCRATCH/venv/bin/pip" install --no-index --no-build-isolation --no-deps . 2>&1)
result "pip install ."
detail=$(nm -D --defined-only "$SCRATCH"/venv/lib/python3*/site-packages/karst/_karst.abi3.so | grep -v ' PyInit__karst$')
[ -z "$detail" ] && [ -e "$(echo "$SCRATCH"/venv/lib/python3*/site-packages/karst/share/karst/worlds/hills.karst)" ]
result "the module exports nothing of the library's, and brings the worlds"

# The command by an absolute path: tests work in folders of their own. Each test is a line of theirs.
export KARST=$(realpath "$KARST") KARST_SHARED=$(realpath "$SHARED") TAP=$SCRATCH/tap TMPDIR=$SCRATCH PYTHONDONTWRITEBYTECODE=1
here=$PWD
(cd "$SCRATCH" && venv/bin/python -m pytest -q -p no:cacheprovider "$here/tests/python" > pytest.log 2>&1)
[ -s "$TAP" ] && ! grep -q '^not ok' "$TAP" || sed 's/^/# /' "$SCRATCH/pytest.log" | tail -n 100
while read -r line; do
    case $line in
    "ok - "*) true && result "${line#ok - }" ;;
    "not ok - "*) false || result "${line#not ok - }" ;;
    "skip - "*) skip "${line#skip - }" "see the test" ;;
    esac
done < "$TAP"
grep -q '^[0-9]* passed' "$SCRATCH/pytest.log" || grep -q '[0-9]* passed' "$SCRATCH/pytest.log"
result "pytest ran to its end"

# ---- the examples, small ----
if "$python" -c 'import matplotlib' 2> /dev/null; then
    export MPLCONFIGDIR=$SCRATCH
    for example in "churn --frames 4 --size 64 48" "speed_against_error --size 64 48 --details 2 4 --rays 50 --repeats 2" \
        "own_density --terms 6 --size 64 48"; do
        set -- $example
        name=$1
        shift
        detail=$("$SCRATCH/venv/bin/python" "python/examples/$name.py" "$@" -o "$SCRATCH/$name.png" 2>&1) &&
            head -c 8 "$SCRATCH/$name.png" | od -An -c | grep -q 'P   N   G'
        result "example $name"
    done
else
    skip "the examples" "no matplotlib"
fi
"$SCRATCH/venv/bin/pip" uninstall -q -y karst && ! ls -d "$SCRATCH"/venv/lib/python3*/site-packages/*karst* > /dev/null 2>&1
result "pip uninstall leaves nothing"
[ $num_failures -gt 0 ] || rm -rf "$SCRATCH"
finish
