# Reads tests/lint/rooms, then `path:line:#include ...`, and complains where an include goes up, or across where it must not.

function folder(path)
{
    return path ~ /\// ? substr(path, 1, match(path, /\/[^\/]*$/) - 1) : ""
}

# Demos, tests and public headers are a room each, with all that lies in them.
function room(path, at)
{
    if (path ~ /^(core\/include\/)?karst\//) return "public"
    if (match(path, /^(demos|tests)\//)) return substr(path, 1, RLENGTH - 1)
    at = folder(path)
    if (at ~ /^core\/engine(\/|$)/) return "engine"
    return at ~ /^(core|noise|cache|producers|raycast|reference)(\/|$)/ ? at : ""
}

function allowed(from, to, target)
{
    if (from == "tests" || from == to) return 1
    if (to == "tests" || to == "demos") return 0
    if (from == "engine") return 1
    if (to == "engine") return 0
    if (to == "public") return from != "noise"
    if (from == "public" || from == "demos") return 0
    return (from, to) in below || (from, target) in below
}

FILENAME != "-" && FILENAME != "" {
    if ($0 ~ /^#/ || $0 ~ /^[[:space:]]*$/) next
    sub(/:/, " ")
    known[$1] = 1
    for (i = 2; i <= NF; i++) below[$1, $i] = 1
    next
}

{
    split($0, part, ":")
    path = part[1]
    if (!match($0, /[<"][^>"]*[>"]/)) next
    target = substr($0, RSTART + 1, RLENGTH - 2)
    system_header = substr($0, RSTART, 1) == "<"
    from = room(path)
    if (from == "") next
    if (from !~ /^(public|engine|demos|tests)$/ && !(from in known)) {
        printf "%s:%s: [arrow] tests/lint/rooms has no room %s\n", path, part[2], from
        next
    }
    to = room(target)
    # Names without a folder: the system's, or a neighbour's.
    if (to == "") {
        if (target !~ /\// || system_header) next
        to = "outside"
    }
    if (!allowed(from, to, target))
        printf "%s:%s: [arrow] %s may not include %s\n", path, part[2], from, target
}
