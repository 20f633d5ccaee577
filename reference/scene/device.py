# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of NumPy for compiled kernels, and back. Kernels depend neither on how many numbers there
are nor on where their memory lies.

Types of Mitsuba and Dr.Jit stand in quotes, here and in all of `reference`: they exist once a
variant is chosen. The name says the precision, `mi.Float64` and `mi.Vector3d` double, `mi.Float`
and `mi.Vector3f` single; an array has an entry for each lane. Mitsuba's arithmetic turns points
into vectors and back: a type says which of the two is meant.
"""

from collections.abc import Callable
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

DeviceArray = TypeVar("DeviceArray")  #: a class of Dr.Jit or Mitsuba, such as `mi.Float64`


def on_device(
    kind: Callable[[NDArray[np.generic]], DeviceArray], numbers: ArrayLike
) -> DeviceArray:
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


def vectors(kind: Callable[..., DeviceArray], rows: ArrayLike) -> DeviceArray:
    """Return rows, (n, 3), as vectors of a kind such as `mi.Vector3d`.

    Each component is copied by itself: an array of all of them at once would make their number a
    constant of the kernel.
    """
    return kind(*(on_device(dr.value_t(kind), column) for column in np.asarray(rows).T))


def as_rows(values: "mi.Vector3f | mi.Vector3d | mi.Color3f") -> NDArray[np.float64]:
    """Return vectors or colours as rows, (n, 3); each component is copied by itself."""
    dr.eval(values)
    components = [np.array(component, dtype=np.float64) for component in values]
    return np.stack(np.broadcast_arrays(*components), axis=1)
