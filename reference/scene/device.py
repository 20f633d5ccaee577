# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of NumPy for compiled kernels, which do not depend on how many there are or
where their memory lies.
"""

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray


def on_device(kind: Any, numbers: ArrayLike) -> Any:
    """Return numbers, (n,), as an array of a kind such as `mi.Float64`.

    Dr.Jit reads NumPy's memory as it stands, and compiles a kernel for the alignment of all arrays
    that it reads: if NumPy's alignment varies, the same kernel is compiled again and again. Numbers
    are copied to Dr.Jit's alignment.
    """
    given = np.asarray(numbers)
    dtype = np.dtype({"Float32": "f4", "Float64": "f8", "UInt32": "u4"}[dr.type_v(kind).name])
    # A block with room to begin at a multiple of 64 bytes, as memory that Dr.Jit allocates does.
    alignment = 64
    memory = np.empty(given.size * dtype.itemsize + alignment, np.uint8)
    first = -memory.ctypes.data % alignment
    aligned = memory[first : first + given.size * dtype.itemsize].view(dtype)
    aligned[:] = given
    return kind(aligned)


def vectors(kind: Any, rows: ArrayLike) -> Any:
    """Return rows, (n, 3), as vectors of a kind such as `mi.Vector3d`; of all at once
    their number is a constant.
    """
    return kind(*(on_device(dr.value_t(kind), column) for column in np.asarray(rows).T))


def as_rows(values: Any) -> NDArray[np.float64]:
    """Return vectors or colours as rows, (n, 3), for the same reason one
    component after the other.
    """
    dr.eval(values)
    components = [np.array(component, dtype=np.float64) for component in values]
    return np.stack(np.broadcast_arrays(*components), axis=1)
