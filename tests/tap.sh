# For shell tests, to be sourced: TAP lines and the exit status.
num_tests=0
num_failures=0

# result NAME: a test that passed if the command before it did. Lines of detail may follow in $detail.
result()
{
    result_status=$?
    num_tests=$((num_tests + 1))
    if [ $result_status -eq 0 ]; then
        echo "ok $num_tests - $1"
    else
        echo "not ok $num_tests - $1"
        num_failures=$((num_failures + 1))
        [ -n "${detail:-}" ] && echo "$detail" | sed 's/^/# /'
        # The leak checker itself may have crashed in a program whose words the detail has not whole: tests/run.sh asks.
        grep -hs 'LeakSanitizer has encountered a fatal error' stdout stderr | sed 's/^/# /'
    fi
    detail=
}

# skip NAME WHY
skip()
{
    num_tests=$((num_tests + 1))
    echo "ok $num_tests # SKIP $1: $2"
}

# until_caught PID: waits until the process has its own way to end by SIGTERM, a minute at most. Before that it would end
# without a word, and on a busy machine that takes as long as it takes.
until_caught()
{
    tries=0
    while [ $tries -lt 600 ]; do
        case $(sed -n 's/^SigCgt:[[:space:]]*//p' "/proc/$1/status" 2> /dev/null) in *[4567cdef]???) return ;; esac
        tries=$((tries + 1))
        sleep 0.1
    done
}

finish()
{
    echo "1..$num_tests"
    [ $num_failures -eq 0 ]
    exit
}
