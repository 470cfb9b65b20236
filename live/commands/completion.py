"""``phasedic completion``: what a shell needs to complete commands and options, as a script for bash (and zsh)."""

from __future__ import annotations

import argparse
import re
import shlex

_OPTION = re.compile(r"--[a-z][\w-]*")
_CHOICES = re.compile(r"(--[a-z][\w-]*) \{([^}]*)\}")

_SCRIPT = """# bash completion of phasedic, made by: phasedic completion
# zsh: autoload -U +X bashcompinit && bashcompinit, then source this file
_phasedic() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" known=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W {commands} -- "$word"))
        return
    fi
    case "${{COMP_WORDS[1]}} $before" in
{choices}
    esac
    if [ -z "$known" ] && [ "${{word:0:1}}" = "-" ]; then
        case "${{COMP_WORDS[1]}}" in
{options}
        esac
    fi
    if [ -n "$known" ]; then
        COMPREPLY=($(compgen -W "$known" -- "$word"))
    else
        COMPREPLY=($(compgen -f -- "$word"))
    fi
}}
complete -o filenames -F _phasedic phasedic
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic completion``."""


def command(arguments: argparse.Namespace) -> int:
    """``phasedic completion``."""
    print(script(), end="")
    return 0


def script() -> str:
    """Commands, the options of each, and the words that some options allow."""
    from live.commands.arguments import COMMANDS, parser_of

    parsers = {name: parser_of(name) for name in COMMANDS}
    options = "\n".join(
        f"            {name}) known={shlex.quote(' '.join(_options(parser)))} ;;"
        for name, parser in parsers.items()
    )
    choices = "\n".join(
        f"        {shlex.quote(f'{name} {option}')}) known={shlex.quote(words)} ;;"
        for name, parser in parsers.items()
        for option, words in _choices(parser)
    )
    return _SCRIPT.format(commands=shlex.quote(" ".join(COMMANDS)), options=options, choices=choices)


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """What the help lists: lines that begin with an option, up to their explanation."""
    heads = (line.strip().split("  ")[0] for line in parser.format_help().splitlines() if line[:3] == "  -")
    return [option for head in heads for option in _OPTION.findall(head)]


def _choices(parser: argparse.ArgumentParser) -> list[tuple[str, str]]:
    """Options and the words that they allow, as the usage shows them."""
    usage = " ".join(parser.format_usage().split())
    return [(option, words.replace(",", " ")) for option, words in _CHOICES.findall(usage)]
