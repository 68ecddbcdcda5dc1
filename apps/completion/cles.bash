# SPDX-License-Identifier: BSL-1.0
# Completes the command cles in bash 4.3 or later: source it, or put it where bash-completion finds it.

_cles() {
    # bash breaks words at characters that nouns and URLs are made of. Put them together again: what has no space
    # between it in the line is one word.
    local rest=${COMP_LINE:0:COMP_POINT} trimmed piece i
    local -a words=()
    for ((i = 0; i <= COMP_CWORD; i++)); do
        piece=${COMP_WORDS[i]}
        trimmed=${rest#"${rest%%[![:space:]]*}"}
        if ((${#words[@]} == 0)) || [[ $trimmed != "$rest" ]]; then
            words+=("")
        fi
        words[${#words[@]} - 1]+=${trimmed:0:${#piece}}
        rest=${trimmed:${#piece}}
    done
    local typed=${words[${#words[@]} - 1]}

    # And bash replaces only what follows the last of those characters.
    local breaks='' kept='' character
    for character in : = @; do
        [[ $COMP_WORDBREAKS == *"$character"* ]] && breaks+=$character
    done
    [[ $breaks ]] && kept=${typed%"${typed##*[$breaks]}"}

    local command=${words[0]/#\~\//$HOME/} text
    type -P -- "$command" >/dev/null || command=cles # an alias
    COMPREPLY=()
    while IFS=$'\t' read -r text _; do
        if [[ $text == [\{\[]* ]]; then # JSON, of characters that a quotation may contain
            [[ $typed ]] || COMPREPLY+=("'$text'")
            continue
        fi
        COMPREPLY+=("${text#"$kept"}")
        [[ $text == *[:/=@] ]] && compopt -o nospace
    done < <("$command" __complete "${words[@]:1}" 2>/dev/null)
}
complete -F _cles cles
