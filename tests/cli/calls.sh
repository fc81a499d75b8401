# For tests of the command, to be sourced behind tests/tap.sh, in the checkout's folder: $karst is the program, and its
# worlds are the checkout's. Afterwards the shell is in an empty folder, which goes when it ends.
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
export KARST_DATA_DIR="$PWD/demos"
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1

# run ARGUMENT...: leaves stdout, stderr and $status. Its stdin is $input, a file, if that is set.
run()
{
    "$karst" "$@" > stdout 2> stderr < "${input:-/dev/null}"
    status=$?
    detail="karst $*: exit $status; stdout: $(head -c 300 stdout); stderr: $(head -c 900 stderr)"
}
# complains CODE PATTERN NAME ARGUMENT...: fails with this exit code, says why on stderr, and prints nothing.
complains()
{
    code=$1 pattern=$2 name=$3
    shift 3
    run "$@"
    [ $status -eq "$code" ] && grep -q '^karst: ' stderr && grep -qE -e "$pattern" stderr && [ ! -s stdout ]
    result "$name"
}
