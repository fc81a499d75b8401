# Flattens JSON with one member on a line, two spaces to a depth, into lines of `a.b.c = value`.
/^ *"/ {
    depth = match($0, /"/) - 1
    depth /= 2
    line = substr($0, 2 * depth + 2)
    end = index(line, "\":")
    name[depth] = substr(line, 1, end - 1)
    value = substr(line, end + 3)
    sub(/,$/, "", value)
    if (value == "{") next
    path = name[1]
    for (i = 2; i <= depth; i++) path = path "." name[i]
    print path " = " value
}
