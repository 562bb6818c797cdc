"""``perchhw completion``: what a shell needs to complete verbs, options and files; made from the parser."""

import importlib
from collections.abc import Iterator
from typing import Annotated, Any

import typer

from perchhw.cli.output import emit
from perchhw.cli.shell_scripts import SCRIPTS, CommandWords

app = typer.Typer(add_completion=False)

_GLOBAL = {"--json": "One JSON document on stdout.", "--verbose": "Say more.", "--help": "Say what it does."}


@app.command()
def completion(
    shell: Annotated[str, typer.Argument(help="bash, zsh or fish.")],
) -> int:
    """Print a script that makes the shell complete perchhw; it calls perchhw no more.

    bash: perchhw completion bash > ~/.local/share/bash-completion/completions/perchhw

    zsh: perchhw completion zsh > a folder of $fpath, named _perchhw

    fish: perchhw completion fish > ~/.config/fish/completions/perchhw.fish

    Make it anew after an update.
    """
    if shell not in SCRIPTS:
        raise typer.BadParameter(f"{shell!r}: no script for it; give {', '.join(SCRIPTS)}")
    script = SCRIPTS[shell](list(command_words()))
    emit({"shell": shell, "script": script}, lambda: typer.echo(script))
    return 0


def command_words() -> Iterator[CommandWords]:
    """Every command of the command line, the root first."""
    from perchhw.cli.main import VERBS

    yield CommandWords("perchhw", {name: verb.help for name, verb in VERBS.items()}, _GLOBAL)
    for name, verb in VERBS.items():
        application = importlib.import_module(verb.module).app
        yield from _below(f"perchhw {name}", typer.main.get_command(application))


def _below(chain: str, command: Any) -> Iterator[CommandWords]:
    """A command of typer's own copy of click, and those below it."""
    verbs: dict[str, Any] = getattr(command, "commands", {})
    options = {
        word: getattr(parameter, "help", None) or ""
        for parameter in command.params
        if not getattr(parameter, "hidden", False)
        for word in parameter.opts
        if word.startswith("--")
    }
    said = {name: below.get_short_help_str(100) for name, below in verbs.items()}
    yield CommandWords(chain, said, options | _GLOBAL)
    for name, below in verbs.items():
        yield from _below(f"{chain} {name}", below)
