# Reads arrows, `from to` a line, and prints each circle among them once, its members in order of their names: `a b c`. Circles are
# the strongly connected parts, as Tarjan's algorithm finds them (SIAM Journal on Computing 1, 1972).

function visit(v, i, w, members, num, at)
{
    lowest[v] = order[v] = ++serial
    stack[++height] = v
    is_open[v] = 1
    for (i = 1; i <= num_targets[v]; i++) {
        w = target[v, i]
        if (!(w in order)) {
            visit(w)
            if (lowest[w] < lowest[v]) lowest[v] = lowest[w]
        } else if (is_open[w] && order[w] < lowest[v])
            lowest[v] = order[w]
    }
    if (lowest[v] != order[v]) return
    num = 0
    do {
        w = stack[height--]
        is_open[w] = 0
        for (at = num++; at > 0 && members[at - 1] > w; at--) members[at] = members[at - 1]
        members[at] = w
    } while (w != v)
    for (i = 0; num > 1 && i < num; i++) printf "%s%s", members[i], i < num - 1 ? " " : "\n"
}

$1 != $2 && !(($1, $2) in known) {
    known[$1, $2] = 1
    if (!($1 in num_targets)) names[++num_names] = $1
    target[$1, ++num_targets[$1]] = $2
}

END {
    for (n = 1; n <= num_names; n++)
        if (!(names[n] in order)) visit(names[n])
}
