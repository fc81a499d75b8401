# Reads the list of files, then `path:line:#include "..."`, and prints `from to` where `to` is one of them.
FILENAME != "-" && FILENAME != "" {
    is_ours[$1] = 1
    next
}
{
    path = substr($0, 1, index($0, ":") - 1)
    if (!match($0, /"[^"]*"/)) next
    target = substr($0, RSTART + 1, RLENGTH - 2)
    if (target ~ /^karst\//) target = "core/include/" target
    beside = path
    sub(/[^\/]*$/, target, beside)
    if (target in is_ours) print path, target
    else if (beside in is_ours) print path, beside
}
