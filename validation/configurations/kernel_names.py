# SPDX-License-Identifier: BSD-3-Clause
"""Kernels by name: 'quadrature', 'quadrature-32', or a user's own as 'module:function' or 'file.py:function'."""

from collections.abc import Callable
from functools import partial, wraps
from typing import Any

from analytic.errors import InputError, nearest
from realtime.errors import InputError as MethodError
from realtime.kernels.registry import KERNELS, Kernel
from realtime.methods.user_method import own_errors, user_object


def find_kernel(name: str) -> Callable[..., Any]:
    """Return the kernel function of a name.

    Parameters
    ----------
    name
        A name of `realtime.kernels.registry.KERNELS`, 'name-N' for the same kernel with its first parameter set to the
        whole number N, or a user's own: 'module:function', 'path/to/file.py:function'
        (`realtime.methods.user_method`).

    Raises
    ------
    InputError
        For an unknown name (the message suggests the nearest), a number for a kernel without parameters, and what
        cannot be imported or called.
    """
    if ":" in name:
        return _imported(name)
    record, size = split_name(name)
    if size is None:
        return record.function
    return partial(record.function, **{next(iter(record.parameters)): size})


def split_name(name: str) -> tuple[Kernel, int | None]:
    """Return the record of a kernel, and the N of 'name-N' or None for a plain name.

    Raises
    ------
    InputError
        As `find_kernel`.
    """
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
    """Return 'name-N' for a size N, or the plain name for None."""
    return name if size is None else f"{name}-{size}"


def _imported(name: str) -> Callable[..., Any]:
    try:
        kernel = user_object(name, "kernel")
    except MethodError as error:
        raise InputError(str(error)) from error
    if not callable(kernel):
        raise InputError(f"kernel {name}: it is a {type(kernel).__name__}; wanted a function")

    @wraps(kernel)
    def guarded(*arguments: Any, **parameters: Any) -> Any:
        with own_errors(f"kernel {name}"):
            return kernel(*arguments, **parameters)

    return guarded
