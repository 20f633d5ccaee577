# SPDX-License-Identifier: BSD-3-Clause
"""Arrays from NumPy in memory that is aligned as Dr.Jit's own is."""

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

_ALIGNMENT = 64  # bytes, of memory that Dr.Jit allocates


def aligned_array(scalar: Any, numbers: NDArray[Any]) -> Any:
    """Return numbers as a Dr.Jit array in memory that is aligned as Dr.Jit's own is.

    A Dr.Jit array of NumPy's memory uses it as it stands, and a kernel is compiled, a frozen function recorded, for the
    alignment of each of its arrays: where NumPy puts them by chance, the same kernel is compiled again and again.

    `scalar`: the type of the array, such as `mi.Float`; `numbers`: (n,), in any unit.
    """
    dtype = _dtype(scalar, numbers)
    aligned = _memory(numbers.size * dtype.itemsize)[: numbers.size * dtype.itemsize].view(dtype)
    aligned[:] = numbers
    return scalar(aligned)


def aligned_numbers(scalar: Any, numbers: NDArray[Any]) -> list[Any]:
    """Return numbers as Dr.Jit arrays of one entry each, as `aligned_array` makes them.

    `scalar`, `numbers`: as of `aligned_array`.
    """
    dtype = _dtype(scalar, numbers)
    step = _ALIGNMENT // dtype.itemsize
    aligned = _memory(numbers.size * _ALIGNMENT)[: numbers.size * _ALIGNMENT].view(dtype)
    aligned[::step] = numbers
    return [scalar(aligned[place : place + 1]) for place in range(0, numbers.size * step, step)]


def _dtype(scalar: Any, numbers: NDArray[Any]) -> np.dtype[Any]:
    floats: dict[Any, np.dtype[Any]] = {dr.VarType.Float32: np.dtype("f4"), dr.VarType.Float64: np.dtype("f8")}
    return floats.get(dr.type_v(scalar), numbers.dtype)  # truth values and whole numbers come in their own type


def _memory(size: int) -> NDArray[np.uint8]:
    """Return at least so many bytes of aligned memory, and as many again as Embree may read beyond the last number."""
    memory = np.empty(size + 2 * _ALIGNMENT, dtype=np.uint8)
    return memory[-memory.ctypes.data % _ALIGNMENT :]
