# Reads files of C or OpenCL C that are laid out as ours are (a function begins in the first column, and its braces stand there, or all of
# it is on one line). Prints `function FILE LINE NAME LINES PARAMETERS`; `defines FILE NAME` for those of a .c that other files may call; and
# `uses FILE NAME` for each name in a file.

function finish_comment(text, at)
{
    at = index(text, "*/")
    if (!at) return ""
    in_comment = 0
    return substr(text, at + 2)
}

# The text without comments, strings and characters.
function plain(text, out, at)
{
    if (in_comment) text = finish_comment(text)
    out = ""
    while (!in_comment && match(text, /\/\*|\/\/|"|'/)) {
        at = substr(text, RSTART, RLENGTH)
        out = out substr(text, 1, RSTART - 1)
        text = substr(text, RSTART + RLENGTH)
        if (at == "//") return out
        if (at == "/*") {
            in_comment = 1
            text = finish_comment(text)
        } else if (at == "\"") {
            while (match(text, /^[^"\\]*\\./)) text = substr(text, RLENGTH + 1)
            text = substr(text, index(text, "\"") + 1)
            out = out "0"
        } else {
            while (match(text, /^[^'\\]*\\./)) text = substr(text, RLENGTH + 1)
            text = substr(text, index(text, "'") + 1)
            out = out "0"
        }
    }
    return out text
}

function num_parameters(list, i, c, depth, num)
{
    if (list ~ /^[[:space:]]*(void)?[[:space:]]*\)/) return 0
    num = 1
    for (i = 1; i <= length(list) && depth >= 0; i++) {
        c = substr(list, i, 1)
        if (c == "(") depth++
        else if (c == ")") depth--
        else if (c == "," && depth == 0) num++
    }
    return num
}

# Of "type name(parameters)" whatever the type is.
function see_function(last_line, name, before)
{
    gsub(/__attribute__[[:space:]]*\(\([^()]*(\([^()]*\))?[^()]*\)\)/, "", head)
    if (!match(head, /[A-Za-z_][A-Za-z0-9_]*[[:space:]]*\(/)) return
    name = substr(head, RSTART, RLENGTH)
    sub(/[[:space:]]*\($/, "", name)
    before = substr(head, 1, RSTART - 1)
    if (before !~ /[A-Za-z_]/) return
    # Arguments of kernels cannot be put together, so their number is not counted.
    printf "function %s %d %s %d %d\n", FILENAME, head_line, name, last_line - head_line + 1,
        before ~ /__kernel/ ? 0 : num_parameters(substr(head, RSTART + RLENGTH))
    if (before !~ /(^|[^A-Za-z_])(static|inline|[A-Z]+_INLINE)([^A-Za-z_]|$)/ && FILENAME ~ /\.c$/)
        printf "defines %s %s\n", FILENAME, name
}

FNR == 1 { head = ""; is_open = in_comment = goes_on = 0; split("", seen) }

{
    was_macro = goes_on
    goes_on = $0 ~ /\\$/ && (was_macro || $0 ~ /^[[:space:]]*#/)
    text = plain($0)
    rest = text
    while (match(rest, /[A-Za-z_][A-Za-z0-9_]*/)) {
        word = substr(rest, RSTART, RLENGTH)
        rest = substr(rest, RSTART + RLENGTH)
        if (!(word in seen)) {
            seen[word] = 1
            print "uses", FILENAME, word
        }
    }
    if (was_macro || text ~ /^[[:space:]]*#/) next
    if (is_open) {
        if (text ~ /^}/) {
            see_function(FNR)
            is_open = 0
            head = ""
        }
        next
    }
    if (text ~ /^[A-Za-z_]/) {
        head = text
        head_line = FNR
    } else if (head != "" && text ~ /^[[:space:]]/)
        head = head " " text
    if (text ~ /^{/ && head ~ /\)[[:space:]]*$/) {
        is_open = 1
        next
    }
    if (head ~ /\)[[:space:]]*{.*}[[:space:]]*$/ && head !~ /=[^=].*{/) {
        see_function(FNR)
        head = ""
    } else if (head ~ /[;}][[:space:]]*$/ || text ~ /^[{}]/)
        head = ""
}
