# SPDX-License-Identifier: BSD-3-Clause
"""How `--help` is drawn: what one types, no types, and nothing but letters where NO_COLOR asks for it."""

from typing import Any

import typer.core

from reports.tables.terminal import colours_wanted


class HelpfulCommand(typer.core.TyperCommand):
    """A command whose help reads well at 80 columns."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the line of usage."""
        return [self.options_metavar or "", *(_usage(each) for each in self.get_params(ctx) if _is_argument(each))]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        _arrange(self.get_params(ctx))
        super().format_help(ctx, formatter)


class HelpfulGroup(typer.core.TyperGroup):
    """The command line as a whole, as `HelpfulCommand`."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        _arrange(self.get_params(ctx))
        super().format_help(ctx, formatter)


def _is_argument(parameter: Any) -> bool:
    return parameter.param_type_name == "argument"


def _usage(argument: Any) -> str:
    name = argument.metavar or argument.name.upper()
    if " " in name:  # says by itself how many words there are
        return name
    several = f"{name}..." if argument.nargs == -1 else name
    return several if argument.required else f"[{several}]"


def _arrange(parameters: Any) -> None:
    from typer import rich_utils

    for parameter in parameters:
        if _is_argument(parameter):  # its type would stand there as <str>
            parameter.display_type_rich = lambda ctx: ""
        elif getattr(parameter, "is_flag", False) and parameter.metavar is None:
            parameter.metavar = ""
    # Rich by itself leaves bold and dim letters where NO_COLOR is set.
    rich_utils.COLOR_SYSTEM = "auto" if colours_wanted() else None
