# Completion of karst for bash. What there is to complete comes from karst's own help.
_karst()
{
    local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} words=
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="$(karst --help 2> /dev/null | sed -n 's/^  karst \([a-z]*\)  .*/\1/p') help --help --version"
        mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
        return
    fi
    case $before in
    --display) words="auto egl osmesa none" ;;
    --mode) words="fly walk orbit" ;;
    --view) words="picture level bricks steps age produced provisional depth normal" ;;
    --export) words=text ;;
    --path | --replay) words="walk low-flight orbit dive jump" ;;
    -o | --output | --stats | --plot | --folder | --edits | --backup | --recover)
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
        return
        ;;
    esac
    if [ -z "$words" ] && [[ $current == -* ]]; then
        words=$(karst help "$command" 2> /dev/null | grep -oE '^ +(-[a-z], )? *--[a-z][a-z-]*' | grep -oE -e '--[a-z-]+')
    elif [ -z "$words" ] && [ "$command" = help ]; then
        words=$(karst --help 2> /dev/null | sed -n 's/^  karst \([a-z]*\)  .*/\1/p')
    elif [ -z "$words" ]; then
        words=$(karst help render 2> /dev/null | sed -n '/^Worlds/,/^$/s/^  \([a-z0-9_-]*\) .*/\1/p')
        mapfile -t COMPREPLY < <(compgen -f -X '!*.karst*' -- "$current")
    fi
    local more
    mapfile -t more < <(compgen -W "$words" -- "$current")
    COMPREPLY+=("${more[@]}")
    case $before in --path | --replay)
        mapfile -t more < <(compgen -f -X '!*.json' -- "$current")
        COMPREPLY+=("${more[@]}")
        ;;
    esac
}
complete -o filenames -F _karst karst
