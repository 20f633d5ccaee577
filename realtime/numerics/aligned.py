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

    Parameters
    ----------
    scalar
        The type of the array, such as `mi.Float`.
    numbers
        (n,), in any unit.
    """
    floats: dict[Any, np.dtype[Any]] = {dr.VarType.Float32: np.dtype("f4"), dr.VarType.Float64: np.dtype("f8")}
    dtype = floats.get(dr.type_v(scalar), numbers.dtype)  # truth values and whole numbers come in their own type
    # Embree may read a vector beyond the last number.
    memory = np.empty(numbers.size * dtype.itemsize + 2 * _ALIGNMENT, dtype=np.uint8)
    begin = -memory.ctypes.data % _ALIGNMENT
    aligned = memory[begin : begin + numbers.size * dtype.itemsize].view(dtype)
    aligned[:] = numbers
    return scalar(aligned)
