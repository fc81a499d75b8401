# Reads tests/lint/exceeding, then `function ...` (functions.awk), `file PATH LINES` and `circle OF PATH PATH ...`, and complains of what is
# beyond the limits and not listed, and of what is listed and no longer beyond them.

function complain(place, rule, text) { printf "%s: [%s] %s\n", place, rule, text }

FILENAME != "-" && FILENAME != "" {
    if ($0 ~ /^#/ || $0 ~ /^[[:space:]]*$/) next
    list = FILENAME
    line[$1, $2, $1 == "function" ? $3 : ""] = FNR
    for (i = 2; $1 == "circle" && i <= NF; i++) {
        line[$1, $i, ""] = FNR
        circle[$i] = FNR
    }
    next
}

# Whether it stands in the list, which is then right about it.
function is_listed(kind, path, name)
{
    is_met[kind, path, name] = 1
    return (kind, path, name) in line
}

$1 == "function" && $5 > 150 && !is_listed("function", $2, $4) {
    complain($2 ":" $3, "long", $4 " has " $5 " lines: make parts with names of it; 150 is the limit")
}
$1 == "function" && $6 > 10 && !is_listed("function", $2, $4) {
    complain($2 ":" $3, "parameters", $4 " has " $6 " parameters: put into structs what belongs together; 10 is the limit")
}
$1 == "file" && $3 > 700 && !is_listed("file", $2, "") {
    complain($2 ":" $3, "size", $3 " lines: are there two rooms in it? 700 is the limit")
}
$1 == "circle" {
    is_old = 1
    for (i = 3; i <= NF; i++) is_old = is_listed("circle", $i, "") && circle[$i] == circle[$3] && is_old
    members = $0
    sub(/^circle [a-z]+ /, "", members)
    if (!is_old) complain($3 ":1", "circle", "of " $2 ": " members)
}

END {
    for (key in line)
        if (!(key in is_met)) {
            split(key, part, SUBSEP)
            complain(list ":" line[key], "list", part[2] (part[3] == "" ? "" : " " part[3]) \
                     (part[1] == "circle" ? " is in no circle" : " is within the limits") ": take it out of the list")
        }
}
