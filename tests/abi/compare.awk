# Reads two dumps, what was promised and what is there, and prints what breaks a program that was built before: a line
# each. Additions do not. -v young=1, as long as the first number of the version is 0: neither do new fields of structs,
# nor new values of enumerations, if those that were there follow one another as before.

# What a line declares.
function name_of(line, at)
{
    if (line ~ /^#define/) return substr(line, 9, index(substr(line, 9), " ") - 1)
    if (line ~ /^typedef (struct|enum) (karst_[a-z0-9_]* )?\{/) { match(line, /[a-z0-9_]+;$/); return substr(line, RSTART, RLENGTH - 1) }
    if (line ~ /^typedef/ && match(line, /karst_[a-z0-9_]*(;|\))/)) return "typedef " substr(line, RSTART, RLENGTH - 1)
    if (match(line, /karst_[a-z0-9_]*\(/)) return substr(line, RSTART, RLENGTH - 1)
    return line
}

# Whether all parts of `before` stand in `now`, in their order.
function is_grown(before, now, parts, num, i, at)
{
    if (!young || before !~ /^typedef (struct|enum)/) return 0
    num = split(before, parts, before ~ /^typedef enum/ ? "[,{}]" : "[;{}]")
    for (i = 1; i <= num; i++) {
        sub(/^ +/, "", parts[i])
        sub(/ +$/, "", parts[i])
        if (parts[i] ~ /^KARST_NUM_/) continue
        at = index(now, parts[i])
        if (!at) return 0
        now = substr(now, at + length(parts[i]))
    }
    return 1
}

NR == FNR { promised[name_of($0)] = $0; next }
{ there[name_of($0)] = $0 }
END {
    for (name in promised)
        if (!(name in there))
            print name " is gone"
        else if (there[name] != promised[name] && !is_grown(promised[name], there[name]))
            print name " was  " promised[name] "\n" name " is   " there[name]
}
