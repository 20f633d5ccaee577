# SPDX-License-Identifier: BSD-3-Clause
"""Refuses work that needs more memory than the machine has, before it allocates any."""

import os

from realtime.errors import InputError


def machine_memory() -> int | None:
    """Return the physical memory of the machine [bytes], or None if the system does not tell."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def check_memory(what: str, needed: int, advice: str) -> None:
    """Raise an error if work needs more memory than the machine has.

    Parameters
    ----------
    what
        What the user asked for, as the message begins.
    needed
        Memory that the work needs [bytes].
    advice
        What the user can do, as the message ends.

    Raises
    ------
    InputError
        If the machine has less memory.
    """
    machine = machine_memory()
    if machine is not None and needed > machine:
        raise InputError(
            f"{what}: needs {needed / 1e9:.3g} GB of memory, this machine has {machine / 1e9:.3g} GB; {advice}"
        )
