# SPDX-License-Identifier: BSD-3-Clause
"""What `--method`, `--kernel` and `--set` name; the command itself never imports methods of the user's own."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from reports.machine.own_process import LIMIT

if TYPE_CHECKING:
    from validation.study.configuration import Configuration

ALL = "all"  #: the word for all built-in methods


def check_limit(limit: float) -> None:
    """Refuse a limit that nothing can keep."""
    from analytic.errors import InputError

    if not 0 < limit < float("inf"):
        raise InputError(f"--method-limit: got {limit:g}, wanted a time above 0, such as 300 [s]")


def checked_configuration(
    method: str, kernel: str | None = None, settings: dict[str, Any] | None = None, *, limit: float = LIMIT
) -> "Configuration":
    """Return a configuration, checked; the user's own method is imported in a process of its own."""
    from reports.machine.own_process import in_own_process
    from validation.study.configuration import configuration

    check_limit(limit)
    if ":" not in method and ":" not in (kernel or ""):
        return configuration(method, kernel, settings)
    return in_own_process(configuration, method, kernel, settings, name=method, limit=limit)


def named_configurations(
    methods: Sequence[str],
    kernels: Sequence[str],
    settings: Sequence[str],
    *,
    usual: "Sequence[Configuration] | None" = None,
    limit: float = LIMIT,
) -> "list[Configuration]":
    """Return what `bench` and `report` measure, by what `--method`, `--kernel` and `--set` say.

    Parameters
    ----------
    methods
        Names, a user's own, and `ALL`; none for `ALL`.
    kernels
        For each of them, every method is measured.
    settings
        NAME=VALUE, parameters of every method.
    usual
        Of `ALL`; the standard configurations of every built-in method by default.
    limit
        Of methods of the user's own [s].

    Raises
    ------
    InputError
        For unknown names, and for a kernel or a parameter that no method is named for.
    """
    from analytic.errors import InputError
    from realtime.methods.registry import FOG_METHODS
    from validation.study.configuration import chosen_configurations, parse_settings

    check_limit(limit)
    given = parse_settings(settings)
    option = "--set" if given else "--kernel" if kernels else ""
    chosen: list[Configuration] = []
    for name in methods or [ALL]:
        if name == ALL:
            if option:
                raise InputError(f"{option}: got no single method that it is for; name methods by --method")
            chosen += chosen_configurations(list(FOG_METHODS)) if usual is None else usual
        elif option or ":" in name:
            chosen += [checked_configuration(name, kernel, given, limit=limit) for kernel in kernels or (None,)]
        else:
            chosen += chosen_configurations([name])
    return list(dict.fromkeys(chosen))
