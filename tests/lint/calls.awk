# From what functions.awk says to `from to`: which .c names functions of which other, be it to call them or to hand them on. Names that
# several files define are each one's own.
$1 == "defines" {
    if ($3 in home) is_shared[$3] = 1
    home[$3] = $2
}
$1 == "uses" {
    from[++num] = $2
    name[num] = $3
}
END {
    for (i = 1; i <= num; i++)
        if (name[i] in home && !(name[i] in is_shared) && home[name[i]] != from[i]) print from[i], home[name[i]]
}
