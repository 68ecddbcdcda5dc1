# SPDX-License-Identifier: BSL-1.0
# Completes the command cles in fish: put it into ~/.config/fish/completions.

function __cles_complete
    set -l words (commandline -opc)
    set -l command $words[1]
    set -e words[1]
    set -l typed (commandline -ct)
    $command __complete $words "$typed" 2>/dev/null
end

complete -c cles -f -a '(__cles_complete)'
