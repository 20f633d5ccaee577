# SPDX-License-Identifier: BSD-3-Clause
"""Refusing work that needs more memory than the machine has, before any of it is taken."""

import os

from realtime.errors import InputError


def machine_memory() -> int | None:
    """Return how much memory the machine has, or None where it does not say [bytes]."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def check_memory(what: str, needed: int, advice: str) -> None:
    """Refuse what needs more memory than the machine has.

    Parameters
    ----------
    what
        What was given, at the beginning of the message.
    needed
        Memory [bytes].
    advice
        What to do, at its end.

    Raises
    ------
    InputError
        If the machine has less.
    """
    machine = machine_memory()
    if machine is not None and needed > machine:
        raise InputError(
            f"{what}: needs {needed / 1e9:.3g} GB of memory, this machine has {machine / 1e9:.3g} GB; {advice}"
        )
