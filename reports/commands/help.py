# SPDX-License-Identifier: BSD-3-Clause
"""How `--help` is drawn: what one types, in panels, at most as wide as the terminal.

Typer's own drawing imports all of Rich, which takes longer than everything else that `airlight --help` does.
"""

import enum
import re
import shutil
import sys
from collections.abc import Sequence
from inspect import cleandoc
from textwrap import wrap
from typing import Any

import typer.core

from reports.tables.terminal import colours_wanted

_NARROWEST = 60
_WIDEST = 100  #: longer lines are hard to read
_NAMES = 26  #: what is longer stands on a line of its own
_TIED = "\0"  #: a space at which no line may end
_BOLD, _DIM, _NAME = "1", "2", "1;36"  #: codes of terminals


class HelpfulCommand(typer.core.TyperCommand):
    """A command whose help is drawn here."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the line of usage."""
        return [self.options_metavar or "", *(_usage(each) for each in self.get_params(ctx) if _is_argument(each))]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        formatter.write(_drawn(self, ctx))


class HelpfulGroup(typer.core.TyperGroup):
    """The command line as a whole, whose help is drawn here."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        formatter.write(_drawn(self, ctx))


def _drawn(command: Any, ctx: Any) -> str:
    """Return the help of a command."""
    lines = ["", f" {_styled(' '.join(command.get_usage(ctx).split()), _BOLD)}", ""]
    lines += _prose(command.help or "")
    shown = [each for each in command.get_params(ctx) if not getattr(each, "hidden", False)]
    arguments = [(each.metavar or each.name.upper(), _words(each)) for each in shown if _is_argument(each)]
    options = [(_names(each), _words(each)) for each in shown if not _is_argument(each)]
    panels = {"Arguments": arguments}
    for name, each in getattr(command, "commands", {}).items():
        if not each.hidden:
            summary = " ".join(cleandoc(each.help or "").split("\n\n")[0].split())
            panels.setdefault(each.rich_help_panel or "Commands", []).append((name, summary))
    panels["Options"] = options
    commands = [len(name) for name in getattr(command, "commands", ())]
    for title, rows in panels.items():
        lines += _panel(title, rows, max([*commands, 0]) if title != "Options" else 0) if rows else []
    return "\n".join([*lines, "", *_prose(command.epilog or "")]) + "\n"


def _width() -> int:
    return max(_NARROWEST, min(shutil.get_terminal_size().columns, _WIDEST))


def _prose(words: str) -> list[str]:
    """Return paragraphs as lines, with an empty line behind each."""
    lines = []
    for paragraph in filter(None, cleandoc(words).split("\n\n")):
        flat = " ".join(paragraph.split())
        lines += [*(f" {_marked(line)}" for line in _wrapped(flat, _width() - 2)), ""]
    return lines


def _panel(title: str, rows: Sequence[tuple[str, str]], names: int = 0) -> list[str]:
    """Return rows of names, at least so wide, and words in a box with a title."""
    corners = "╭╮╰╯─│" if (sys.stdout.encoding or "").lower().startswith("utf") else "++++-|"
    width = _width()
    names = min(max(names, *(len(name) for name, _ in rows)), _NAMES)
    side = _styled(corners[5], _DIM)

    def line(name: str, words: str) -> str:
        space = " " * (width - 6 - max(names, len(name)) - len(_plain(words)))
        return f"{side} {_styled(name, _NAME)}{' ' * (names - len(name))}  {_marked(words)}{space} {side}"

    lines = [_styled(f"{corners[0]}{corners[4]} {title} ".ljust(width - 1, corners[4]) + corners[1], _DIM)]
    for name, words in rows:
        described = _wrapped(words, width - 6 - names) or [""]
        if len(name) > names:
            lines.append(line(name, ""))
            name = ""
        lines += [line(name if first else "", each) for first, each in zip([True, *[False] * len(words)], described)]
    return [*lines, _styled(corners[2] + corners[4] * (width - 2) + corners[3], _DIM)]


def _is_argument(parameter: Any) -> bool:
    return parameter.param_type_name == "argument"


def _usage(argument: Any) -> str:
    name = argument.metavar or argument.name.upper()
    if " " in name:  # says by itself how many words there are
        return name
    several = f"{name}..." if argument.nargs == -1 else name
    return several if argument.required else f"[{several}]"


def _names(option: Any) -> str:
    """Return what one types for an option, its value last."""
    names = [*option.opts, *option.secondary_opts]
    value = "" if option.is_flag else f" {option.metavar or option.name.upper()}"
    return ", ".join(names) + value


def _words(parameter: Any) -> str:
    """Return what a parameter does, which numbers it takes and its default."""
    low, high = (_limit(parameter, name) for name in ("min", "max"))
    limits = f"{low} to {high}" if None not in (low, high) else f"at least {low}" if low is not None else ""
    notes = [limits] if limits and not parameter.is_flag else []
    default = parameter.default
    if parameter.required:
        notes.append("required")
    elif parameter.show_default and default not in (None, False, "", (), []) and not callable(default):
        value = default.value if isinstance(default, enum.Enum) else default
        value = f"{value:g}" if isinstance(value, float) else value
        notes.append(f"default: {parameter.opts[0].lstrip('-') if value is True else value}")
    noted = f"[{', '.join(notes)}]".replace(" ", _TIED)
    return f"{parameter.help or ''} {noted}" if notes else parameter.help or ""


def _limit(parameter: Any, name: str) -> Any:
    """Return the limit of a number; Typer keeps it with the parameter, older ones with its type."""
    limit = getattr(parameter, name, None)
    return getattr(parameter.type, name, None) if limit is None and hasattr(parameter, "type") else limit


def _wrapped(words: str, width: int) -> list[str]:
    """Return words in lines as long as they are without marks; what stands in backticks is not parted."""
    kept = re.sub(r"`[^`]+`", lambda code: code[0].replace(" ", _TIED), words)
    marked = iter(kept.split())  # marks take no room: lines are wrapped without them, and get them back word by word
    lines = wrap(_plain(kept), width, break_on_hyphens=False, break_long_words=False)
    return [" ".join(next(marked) for _ in line.split()).replace(_TIED, " ") for line in lines]


def _plain(words: str) -> str:
    return words.replace("`", "").replace("**", "")


def _marked(words: str) -> str:
    """Return words with what stands in backticks or stars in bold, without these."""
    return re.sub(r"`([^`]*)`|\*\*([^*]*)\*\*", lambda match: _styled(match[1] or match[2], _BOLD), words)


def _styled(words: str, code: str) -> str:
    plain = not words or not sys.stdout.isatty() or not colours_wanted()
    return words if plain else f"\x1b[{code}m{words}\x1b[0m"
