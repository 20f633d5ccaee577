# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of Dr.Jit: types of one precision, arrays from NumPy, and the way back to the host.

Types come in sets of one precision, so that every method runs in float32 and
float64 from the same source.

NumPy's arrays are copied to memory that is aligned as Dr.Jit's own is.

A frame brings numbers of a scene from the device to the host in one way, `host_numbers`. It reads a
few numbers of lights and cameras; each such read waits until the device has come to rest.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError

PRECISIONS = ("single", "double")

# Contents of arrays, for signatures. Dr.Jit has a class for each precision and backend, so
# their type is not checked.
PerRay: TypeAlias = Any  #: one entry per ray: a number, a vector or a colour
Metres: TypeAlias = Any  #: lengths [m]
PerMetre: TypeAlias = Any  #: extinctions, inverse depths and airlight integrals [1/m]


@dataclass(frozen=True)
class ArrayTypes:
    """The array types of one precision and of Mitsuba's current variant."""

    scalar: Any  #: one floating-point number per lane
    vector: Any  #: three-vector: positions, directions
    color: Any  #: linear RGB


def array_types(precision: str = "single") -> ArrayTypes:
    """Return the array types of a precision.

    `precision`: 'single' (float32) or 'double' (float64). Rays are always cast in float32, the only
    precision of Mitsuba's wheels. Raises InputError if the precision has another name.
    """
    if precision == "single":
        return ArrayTypes(mi.Float, mi.Vector3f, mi.Color3f)
    if precision == "double":
        return ArrayTypes(mi.Float64, mi.Vector3d, mi.Color3d)
    raise InputError(f"precision: got {precision!r}, expected one of {', '.join(PRECISIONS)}")


def types_of(Float) -> ArrayTypes:
    """Return the array types of the precision of a number type."""
    return array_types("single" if is_single(Float) else "double")


def is_single(Float) -> bool:
    """Return whether a number type is float32; Python's float, the number of
    the scalar backend, is not.
    """
    return dr.is_array_v(Float) and dr.itemsize_v(Float) == 4


def bytes_of(Float) -> int:
    """Return how much memory a number of a type takes in arrays [bytes]."""
    return 4 if is_single(Float) else 8


def two_numbers(Float):
    """Return the type of two numbers of a type, which a gather reads at once."""
    return mi.Vector2f if is_single(Float) else mi.Vector2d


def four_numbers(Float):
    """Return the type of four numbers of a type, which a gather reads at once."""
    return mi.Vector4f if is_single(Float) else mi.Vector4d


def packed(numbers):
    """Return an array with the four numbers of every lane side by side, for
    gathers that read them at once.
    """
    width = dr.width(numbers)
    # A scatter of vectors writes the four numbers of a lane next to one another.
    array = dr.zeros(type(numbers.x), 4 * width)
    dr.scatter(array, numbers, dr.arange(mi.UInt32, width))
    return array


def smallest(Float) -> float:
    """Return the smallest normal number of a type."""
    return 2.0**-126 if is_single(Float) else 2.0**-1022


def largest(Float) -> float:
    """Return the largest number of a type."""
    return (2 - 2.0**-23) * 2.0**127 if is_single(Float) else (2 - 2.0**-52) * 2.0**1023


def chosen_value(values, number):
    """Return the value of a number, counted from 0, which may differ between lanes;
    `values` are arrays of one type.
    """
    # Selections, not a gather: the values are arrays of their own.
    chosen, *others = values
    for place, value in enumerate(others, 1):
        chosen = dr.select(number == place, value, chosen)
    return chosen


_ALIGNMENT = 64  # bytes, of memory that Dr.Jit allocates


def aligned_array(scalar: Any, numbers: NDArray[Any]) -> Any:
    """Return numbers as a Dr.Jit array in memory that is aligned as Dr.Jit's own is.

    A Dr.Jit array of NumPy's memory uses it as it stands, and a kernel is compiled, a frozen
    function recorded, for the alignment of each of its arrays: where NumPy puts them by chance, the
    same kernel is compiled again and again.

    `scalar`: the type of the array, such as `mi.Float`; `numbers`: (n,), in any unit.
    """
    dtype = _dtype(scalar, numbers)
    # The memory may end later than the numbers do; the array has as many entries as they.
    aligned = _memory(numbers.size * dtype.itemsize)[: numbers.size * dtype.itemsize].view(dtype)
    aligned[:] = numbers
    return scalar(aligned)


def aligned_numbers(scalar: Any, numbers: NDArray[Any]) -> list[Any]:
    """Return numbers as Dr.Jit arrays of one entry each, as `aligned_array` makes them.

    `scalar`, `numbers`: as for `aligned_array`.
    """
    dtype = _dtype(scalar, numbers)
    # One number at the beginning of each aligned piece; the rest of a piece stays unused.
    step = _ALIGNMENT // dtype.itemsize
    aligned = _memory(numbers.size * _ALIGNMENT)[: numbers.size * _ALIGNMENT].view(dtype)
    aligned[::step] = numbers
    return [scalar(aligned[place : place + 1]) for place in range(0, numbers.size * step, step)]


def _dtype(scalar: Any, numbers: NDArray[Any]) -> np.dtype[Any]:
    floats: dict[Any, np.dtype[Any]] = {
        dr.VarType.Float32: np.dtype("f4"),
        dr.VarType.Float64: np.dtype("f8"),
    }
    # truth values and whole numbers come in their own type
    return floats.get(dr.type_v(scalar), numbers.dtype)


def _memory(size: int) -> NDArray[np.uint8]:
    """Return at least so many bytes of aligned memory, and as many again as Embree may
    read beyond the last number.
    """
    # One alignment is lost before the first aligned byte, the other lies behind the numbers.
    memory = np.empty(size + 2 * _ALIGNMENT, dtype=np.uint8)
    return memory[-memory.ctypes.data % _ALIGNMENT :]


def host_numbers(*values: Any) -> tuple[NDArray[np.float64], ...]:
    """Bring values to the host together.

    `values`: Dr.Jit numbers and vectors of one entry each, in any unit and precision. Returns
    `numbers`: by value its components, (n,), in float64.
    """
    # All components in one list, so that one transfer brings them; the lengths cut it up again.
    components = [tuple(value) if dr.depth_v(value) > 1 else (value,) for value in values]
    every = [component for of_value in components for component in of_value]
    numbers = _element_by_element(every) if _on_processor(every[0]) else _in_one_transfer(every)
    ends = np.cumsum([len(of_value) for of_value in components])
    return tuple(np.split(numbers, ends[:-1]))


def _on_processor(number: Any) -> bool:
    return bool(dr.backend_v(number) != dr.JitBackend.CUDA)


def _element_by_element(numbers: list[Any]) -> NDArray[np.float64]:
    """Read each number where it lies: on a processor a read takes less than a microsecond,
    and a copy of all numbers takes a kernel.
    """
    return np.array([number[0] for number in numbers], dtype=np.float64)


def _in_one_transfer(numbers: list[Any]) -> NDArray[np.float64]:
    """Gather on the device, then transfer once: every transfer from a GPU waits
    for all that runs there.
    """
    return np.array(dr.concat([mi.Float64(number) for number in numbers]))
