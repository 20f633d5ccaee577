# SPDX-License-Identifier: BSD-3-Clause
"""Methods of the user's own on the command line: the command itself never imports them."""

from typing import TYPE_CHECKING, Any

from reports.machine.own_process import LIMIT

if TYPE_CHECKING:
    from validation.configurations.methods import Configuration


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
    from validation.configurations.methods import configuration

    check_limit(limit)
    if ":" not in method:
        return configuration(method, kernel, settings)
    return in_own_process(configuration, method, kernel, settings, name=method, limit=limit)
