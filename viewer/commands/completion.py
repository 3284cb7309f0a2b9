"""Shell completion of commands, options, names of models and file names."""

from __future__ import annotations

import argparse
from typing import Any

from viewer.commands import COMMANDS
from viewer.commands._batch.jobs import JOBS, add_all_arguments
from viewer.commands._usage import Parser, command_module
from viewer.models.download import ADDABLE

_SHELLS = ("bash", "zsh", "tcsh", "fish")

_FIGURES = {
    "bash": "_viewer_figures",
    "zsh": "_viewer_figures",
    "tcsh": "f",  # a rule of tcsh has either names or files
    "fish": "(viewer models names 2>/dev/null; __fish_complete_path (commandline -ct))",
    "preamble": {
        "bash": """
_viewer_figures() {
  compgen -W "$(viewer models names 2>/dev/null)" -- "$1"
  compgen -f -- "$1"
}""",
        "zsh": """
_viewer_figures() {
  local -a names
  names=(${(f)"$(viewer models names 2>/dev/null)"})
  compadd -a names
  _files
}""",
    },
}
"""Completion of a figure: the name of a model, or a file. The program lists the names, as they
depend on the model folder."""

# Bash splits words at the characters of COMP_WORDBREAKS, but smplx:neutral is one word, and
# --model=fox is two. Bash replaces only the text after the last of these characters.
_BASH = """

_viewer() {
  local rest="${COMP_LINE:0:COMP_POINT}" word gap last="" kept="" count=0 i
  local -a words=()
  for ((i = 0; i <= COMP_CWORD; i++)); do
    word="${COMP_WORDS[i]}"
    gap="${rest%%[![:space:]]*}"
    rest="${rest#"$gap"}"
    rest="${rest#"$word"}"
    if [[ $count = 0 || -n $gap || ! ( $word =~ ^[:=]+$ || $last =~ ^[:=]+$ ) ]]; then
      words[count++]="$word"
      kept=""
    elif [[ $word = "=" && ${words[count - 1]} =~ ^--[a-z-]+$ ]]; then
      words[count++]=""
      kept=""
    else
      [[ $word =~ ^[:=]+$ ]] && kept="${words[count - 1]}$word" || kept="${words[count - 1]}"
      words[count - 1]+="$word"
    fi
    last="$word"
  done
  local -a COMP_WORDS=("${words[@]}")
  local COMP_CWORD=$((count - 1))
  _shtab_viewer
  [[ ${#COMPREPLY[@]} = 0 ]] && return
  local names=0  # readline marks folders, and escapes spaces, if all replies are files
  for word in "${COMPREPLY[@]}"; do
    [[ -e "${word/#\\~\\//$HOME/}" ]] || names=1
  done
  [[ $names = 1 ]] || compopt -o filenames 2>/dev/null
  COMPREPLY=("${COMPREPLY[@]#"$kept"}")
}

complete -o bashdefault -F _viewer viewer"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s bash|zsh|tcsh|fish"
    parser.add_argument(
        "shell", choices=_SHELLS, help="the shell; see below for where to put its script"
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        "bash: viewer completion bash > ~/.local/share/bash-completion/completions/viewer\n"
        "zsh:  viewer completion zsh > a file _viewer in a folder of $fpath\n"
        "tcsh: viewer completion tcsh > a file that ~/.tcshrc sources\n"
        "fish: viewer completion fish > ~/.config/fish/completions/viewer.fish"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    script = shtab.complete(command_line(), arguments.shell)
    print(script + _BASH if arguments.shell == "bash" else script)
    return 0


def command_line() -> argparse.ArgumentParser:
    """Return the whole command line as one parser; values are marked for completion."""
    whole = Parser(prog="viewer", description="View, check and convert skinned characters.")
    whole.add_argument("--version", action="store_true", help="print the version")
    commands: Any = whole.add_subparsers(dest="command", parser_class=Parser)
    for name, text in COMMANDS.items():
        parser = commands.add_parser(name, help=text, description=text)
        if name == "batch":
            jobs: Any = parser.add_subparsers(dest="job", parser_class=Parser)
            for job, kind in JOBS.items():
                inner = jobs.add_parser(job, help=kind.title, description=kind.title)
                add_all_arguments(inner, job)
                _complete_values(inner)
        else:
            command_module(name).add_arguments(parser)
            _complete_values(parser)
    return whole


def _complete_values(parser: argparse.ArgumentParser) -> None:
    """Mark the arguments whose values are files, figures or the names of free models."""
    import shtab

    for action in parser._actions:  # argparse has no public name for this action
        metavar = str(action.metavar or "")
        if action.choices is not None or action.nargs == 0:
            continue
        if metavar == "FIGURE":
            action.complete = _FIGURES  # type: ignore[attr-defined]
        elif metavar == "NAME" and not action.option_strings:
            action.choices = tuple(ADDABLE)
        elif not action.option_strings or metavar.startswith(("FILE", "FOLDER", "OTHER")):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
