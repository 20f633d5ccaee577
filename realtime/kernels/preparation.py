# SPDX-License-Identifier: BSD-3-Clause
"""Kernels that read tables: what must be on the device before a frame is recorded.

A frozen function cannot take an array from the host, and reads one on the device only if it is among its inputs. So a
kernel may have a `prepare`, ``prepare(Float, **parameters) -> tables``, which `prepared_by` gives it. Who freezes a
function calls `prepare_kernel` before, passes what it returns as an input, and calls the kernel as `with_tables` makes
it. A kernel without `prepare` knows nothing of this.
"""

from collections.abc import Callable
from functools import partial
from typing import Any


def prepared_by(prepare: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return a decorator that gives a kernel its `prepare`; the kernel takes the tables as its keyword `tables`."""

    def mark(kernel: Any) -> Any:
        kernel.prepare = prepare
        return kernel

    return mark


def prepare_kernel(kernel: Any, Float: type) -> Any:
    """Return the tables of a kernel, evaluated, in the precision of `Float`; None for one that reads none.

    `kernel`: a kernel function, or a `functools.partial` of one that sets parameters; `Float`: the type of a number per
    ray. Raises InputError for what the kernel's `prepare` refuses.
    """
    function, parameters = (kernel.func, kernel.keywords) if isinstance(kernel, partial) else (kernel, {})
    prepare = getattr(function, "prepare", None)
    return None if prepare is None else prepare(Float, **parameters)


def with_tables(kernel: Any, tables: Any) -> Any:
    """Return the kernel that reads these tables, from `prepare_kernel`."""
    return kernel if tables is None else partial(kernel, tables=tables)
