# What tests of karst $subcommand share, which writes a file of a world, to be sourced: from then on they are in a folder
# of their own. $KARST is the program.
. tests/tap.sh
. tests/cli/calls.sh

run()
{
    "$karst" "$subcommand" "$@" > stdout 2> stderr < /dev/null
    status=$?
    detail="karst $subcommand $*: exit $status; stdout: $(head -c 300 stdout); stderr: $(head -c 600 stderr)"
}
# refused STATUS PATTERN NAME ARGUMENTS: exits so, says why, writes nothing.
refused()
{
    wanted=$1 pattern=$2 name=$3
    shift 3
    rm -f out.*
    run "$@"
    [ $status -eq "$wanted" ] && grep -qE -e "$pattern" stderr && [ -z "$(ls -A | grep -E '^(out|\.karst)')" ]
    result "$name"
}
# stopped NAME ARGUMENTS: work of minutes, ended once it has begun, says so and leaves nothing behind.
stopped()
{
    name=$1
    shift
    rm -f out.*
    "$karst" "$subcommand" "$@" > stdout 2> stderr < /dev/null &
    pid=$!
    until_caught $pid
    kill -TERM $pid
    wait $pid
    status=$?
    [ $status -ne 0 ] && [ -z "$(ls -A | grep -E '^(out|\.karst)')" ] && grep -q interrupted stderr
    detail="exit $status; $(cat stderr); $(ls -A | tr '\n' ' ')" result "$name"
}
