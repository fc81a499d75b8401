# Completion of karst for fish. What there is to complete comes from karst's own help.
function __karst_commands
    karst --help 2>/dev/null | string replace -rf '^  karst ([a-z]+)  +(.*)' '$1\t$2'
    printf 'help\twhat a command does\n'
end
function __karst_options
    set -l words (commandline -opc)
    karst help $words[2] 2>/dev/null | string replace -rf '^ +(-[a-z], )? *(--[a-z][a-z-]*).*' '$2'
end
function __karst_worlds
    karst help render 2>/dev/null | sed -n '/^Worlds/,/^$/s/^  \([a-z0-9_-]*\) .*/\1/p'
end
function __karst_is_after
    contains -- (commandline -opc)[-1] $argv
end
complete -c karst -f
complete -c karst -n 'test (count (commandline -opc)) -eq 1' -a '(__karst_commands)'
complete -c karst -n '__karst_is_after help' -a '(__karst_commands)'
complete -c karst -n 'string match -q -- "-*" (commandline -ct)' -a '(__karst_options)'
complete -c karst -n '__karst_is_after --display' -a 'auto egl osmesa none'
complete -c karst -n '__karst_is_after --mode' -a 'fly walk orbit'
complete -c karst -n '__karst_is_after --view' -a 'picture level bricks steps age produced provisional depth normal'
complete -c karst -n '__karst_is_after --path --replay' -a 'walk low-flight orbit dive jump' -F
complete -c karst -n '__karst_is_after -o --output --stats --plot --folder --edits --backup --recover' -F
complete -c karst -n '__karst_is_after --export' -a 'text'
complete -c karst -n 'test (count (commandline -opc)) -gt 1' -a '(__karst_worlds)'
complete -c karst -n 'test (count (commandline -opc)) -gt 1; and not string match -q -- "-*" (commandline -ct)' \
    -a '(__fish_complete_suffix .karst) (__fish_complete_suffix .karstdb)'
