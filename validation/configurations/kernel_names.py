# SPDX-License-Identifier: BSD-3-Clause
"""Kernels as a user names them: 'quadrature', 'quadrature-32' or one's own, 'module:function'."""

import importlib
from collections.abc import Callable
from functools import partial
from typing import Any

from analytic.errors import InputError, nearest
from realtime.kernels.registry import KERNELS, Kernel


def find_kernel(name: str) -> Callable[..., Any]:
    """Return the kernel function of a name.

    Parameters
    ----------
    name
        A name of `realtime.kernels.registry.KERNELS`; 'name-N', the same with its first parameter set to the whole
        number N; or 'module:function'.

    Raises
    ------
    InputError
        For an unknown name (the nearest is named), a number for a kernel without parameters, and what cannot be
        imported or is no function.
    """
    if ":" in name:
        return _imported(name)
    record, size = split_name(name)
    if size is None:
        return record.function
    return partial(record.function, **{next(iter(record.parameters)): size})


def split_name(name: str) -> tuple[Kernel, int | None]:
    """Return the record of a kernel and the N of 'name-N', None where there is none."""
    if name in KERNELS:
        return KERNELS[name], None
    base, separator, digits = name.rpartition("-")
    if not (separator and base in KERNELS and digits.isascii() and digits.isdecimal()):
        raise InputError(
            f"kernel: got {name!r}, wanted one of {', '.join(KERNELS)}, such a name with '-N', or 'module:function'"
            + nearest(name, KERNELS)
        )
    record = KERNELS[base]
    if not record.parameters:
        raise InputError(f"kernel: got {name!r}, but {base!r} has no parameter to set: leave '-{digits}' out")
    return record, int(digits)


def sized(name: str, size: int | None) -> str:
    """Return 'name-N', or the name alone for no size."""
    return name if size is None else f"{name}-{size}"


def _imported(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"kernel: cannot load {name!r}: {error}; wanted an importable 'module:function'") from error
    if not callable(found):
        raise InputError(f"kernel: {name!r} is a {type(found).__name__}; wanted an importable 'module:function'")
    return found
