# Reads `path:line:#include ...` and complains where an include goes up, or across where it must not (docs/ARCHITECTURE.md).

function layer(path)
{
    if (path ~ /^core\/include\/karst\// || path ~ /^karst\//) return "public"
    if (path ~ /^core\/engine[^\/]*\.(c|h|cl)$/) return "engine"
    if (path ~ /^(core|noise|cache|producers|raycast|reference|demos|tests)\//) return substr(path, 1, index(path, "/") - 1)
    return ""
}

function allowed(from, to, target)
{
    if (from == "tests") return 1
    if (to == "tests" || to == "demos") return from == to
    if (from == "engine") return 1
    if (to == "engine") return 0
    if (from == "noise") return to == "noise" || target == "core/dialect.h" || target == "core/lanes.clh"
    if (to == "public") return 1
    if (from == "public" || from == "demos") return 0
    if (from == to) return 1
    if (from == "core") return 0
    if (from == "cache") return to == "core"
    if (from == "reference") return to == "core" || to == "noise" || to == "producers" || to == "raycast"
    if (to == "reference") return 0
    # Producers and raycast: what lies below, and of the cache only what others are to see.
    return to == "core" || to == "noise" || target == "cache/cache.h" || target == "cache/layout_shared.h"
}

{
    split($0, part, ":")
    path = part[1]
    if (!match($0, /[<"][^>"]*[>"]/)) next
    target = substr($0, RSTART + 1, RLENGTH - 2)
    from = layer(path)
    if (from == "") next
    to = layer(target)
    # Names without a folder: the system's, or a neighbour's.
    if (to == "") {
        if (target !~ /\// || substr($0, RSTART, 1) == "<") next
        to = "outside"
    }
    if (!allowed(from, to, target))
        printf "%s:%s: [arrow] %s may not include %s\n", path, part[2], from, target
}
