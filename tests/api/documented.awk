# The errors that public headers name: FUNCTION CODE, one a line, of each function that takes a karst_error.
#   awk -f tests/api/documented.awk core/include/karst/*.h
# A comment speaks of the functions that follow it, up to the next comment or empty line. "as above" and "the same" take
# over what the function before names, "as karst_other" what that one does. "Errors of all functions below" holds
# to the end of the file. A function whose comments name no code at all is told with NOTHING.
function codes_of(text, into,    found, num, i, words) {
    num = split(text, words, /[^A-Z_]+/)
    for (i = 1; i <= num; i++)
        if (words[i] ~ /^KARST_(FAILED|USAGE|NO_DEVICE|BAD_WORLD|BAD_DATA)$/)
            into[words[i]] = 1
}
# What `text` says of errors goes to codes[name, ...].
function take(name, text,    found, code, rest, other) {
    delete found
    codes_of(text, found)
    if (text ~ /Errors( and progress|:)? as above|of the above|The same|The inverse|Errors: also/)
        for (code in last)
            found[code] = 1
    rest = text
    while (match(rest, /[Ee]rrors:?[^.]* as karst_[a-z0-9_]+/)) {
        other = substr(rest, RSTART, RLENGTH)
        sub(/.* /, "", other)
        rest = substr(rest, RSTART + RLENGTH)
        taken[name, other] = 1
    }
    for (code in general)
        found[code] = 1
    delete last
    for (code in found) {
        codes[name, code] = 1
        last[code] = 1
    }
}
function declare(    name) {
    name = code
    if (name !~ /karst_error \*error\)/ || name ~ /typedef/)
        return
    sub(/\(.*/, "", name)
    sub(/.*[ *]/, "", name)
    if (name !~ /^karst_/)
        return
    order[++num_functions] = name
    take(name, comment " " behind)
}
FNR == 1 { delete general; delete last; comment = code = ""; in_comment = in_body = 0 }
{
    line = $0
    behind = ""
    if (!in_comment && line ~ /;[ ]*\/\*.*\*\//) {
        behind = line
        sub(/.*\/\*/, "", behind)
        sub(/[ ]*\/\*.*/, "", line)
    }
    if (!in_comment && line ~ /^[ ]*\/\*/) {
        comment = ""
        in_comment = 1
    }
    if (in_comment) {
        comment = comment " " line
        if (line ~ /\*\//) {
            in_comment = 0
            gsub(/[ ]*\*\/|\/\*|[ ]\*[ ]/, " ", comment)
            gsub(/[ ]+/, " ", comment)
            if (comment ~ /Errors of all functions below/)
                codes_of(comment, general)
        }
        next
    }
    if (line ~ /^extern/)
        next
    if (line ~ /\{$/)
        in_body = 1
    if (in_body) {
        if (line ~ /^\}/)
            in_body = 0
        next
    }
    if (line ~ /^#/ || line == "") {
        if (line == "")
            comment = ""
        code = ""
        next
    }
    code = code " " line
    if (line ~ /;$/) {
        declare()
        code = ""
    }
}
END {
    for (again = 0; again < 4; again++)
        for (pair in taken) {
            split(pair, part, SUBSEP)
            for (code in codes) {
                split(code, of, SUBSEP)
                if (of[1] == part[2])
                    new[part[1] SUBSEP of[2]] = 1
            }
            for (code in new)
                codes[code] = 1
            delete new
        }
    num_codes = split("KARST_USAGE KARST_BAD_WORLD KARST_BAD_DATA KARST_NO_DEVICE KARST_FAILED", all, " ")
    for (i = 1; i <= num_functions; i++) {
        said = 0
        for (c = 1; c <= num_codes; c++)
            if ((order[i], all[c]) in codes) {
                print order[i], all[c]
                said = 1
            }
        if (!said)
            print order[i], "NOTHING"
    }
}
