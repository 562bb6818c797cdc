"""Scripts by which bash, zsh and fish complete a command line whose commands are known."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple


class CommandWords(NamedTuple):
    """What may follow one command: verbs below it, or options and files.

    Attributes:
        chain: the command with those above it, as typed.
        verbs, options: words with a line of help each.
    """

    chain: str
    verbs: dict[str, str]
    options: dict[str, str]


_BASH = """\
_perchhw() {{
    local current="${{COMP_WORDS[COMP_CWORD]}}" chain=perchhw verbs= options= i
    for ((i = 1; i < COMP_CWORD; i++)); do
        case "$chain ${{COMP_WORDS[i]}}" in
            {chains}) chain="$chain ${{COMP_WORDS[i]}}" ;;
        esac
    done
    case "$chain" in
{cases}
    esac
    if [[ $current == -* ]]; then
        COMPREPLY=($(compgen -W "$options" -- "$current"))
    elif [[ -n $verbs ]]; then
        COMPREPLY=($(compgen -W "$verbs" -- "$current"))
    else
        compopt -o filenames 2> /dev/null
        COMPREPLY=($(compgen -f -- "$current"))
    fi
}}
complete -F _perchhw perchhw"""

_ZSH = """\
#compdef perchhw
_perchhw() {{
    local chain=perchhw
    local -a verbs options
    integer i
    for ((i = 2; i < CURRENT; i++)); do
        case "$chain $words[i]" in
            ({chains}) chain="$chain $words[i]" ;;
        esac
    done
    case "$chain" in
{cases}
    esac
    if [[ $words[CURRENT] == -* ]]; then
        _describe option options
    elif (( $#verbs )); then
        _describe verb verbs
    else
        _files
    fi
}}
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
    _perchhw "$@"
else
    compdef _perchhw perchhw
fi"""

_FISH = """\
function __perchhw_at
    set -l chain perchhw
    for word in (commandline -opc)[2..-1]
        if contains -- "$chain $word" {chains}
            set chain "$chain $word"
        end
    end
    test "$chain" = "$argv"
end
{lines}"""


def _chains(commands: Iterable[CommandWords], between: str) -> str:
    return between.join(f'"{command.chain}"' for command in commands if command.chain != "perchhw")


def bash_script(commands: Sequence[CommandWords]) -> str:
    """For bash 4 or newer."""
    cases = (
        f'        "{one.chain}") verbs="{" ".join(one.verbs)}" options="{" ".join(one.options)}" ;;'
        for one in commands
    )
    return _BASH.format(chains=_chains(commands, "|"), cases="\n".join(cases))


def zsh_script(commands: Sequence[CommandWords]) -> str:
    """For zsh with its completion system."""
    cases = (
        f'        ("{one.chain}") verbs=({_described(one.verbs)}) options=({_described(one.options)}) ;;'
        for one in commands
    )
    return _ZSH.format(chains=_chains(commands, "|"), cases="\n".join(cases))


def _described(words: dict[str, str]) -> str:
    return " ".join(f"'{word}:{_plain(help)}'" for word, help in words.items())


def fish_script(commands: Sequence[CommandWords]) -> str:
    """For fish 3 or newer."""
    lines = []
    for one in commands:
        at = f"complete -c perchhw -n '__perchhw_at {one.chain}'"
        lines += [f"{at} -f -a {verb} -d '{_plain(help)}'" for verb, help in one.verbs.items()]
        lines += [f"{at} -l {word[2:]} -d '{_plain(help)}'" for word, help in one.options.items()]
    return _FISH.format(chains=_chains(commands, " "), lines="\n".join(lines))


def _plain(help: str) -> str:
    """The first line of a help text without what a shell would read."""
    return re.sub(r"[^\w ,.;/()+=%-]", "", help.partition("\n")[0])[:80]


SCRIPTS: dict[str, Callable[[Sequence[CommandWords]], str]] = {
    "bash": bash_script,
    "zsh": zsh_script,
    "fish": fish_script,
}
