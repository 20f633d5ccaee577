# SPDX-License-Identifier: BSD-3-Clause
"""Dr.Jit array types of one precision, so that every method runs in float32 and float64 from the same source."""

from dataclasses import dataclass
from typing import Any, TypeAlias

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError

PRECISIONS = ("single", "double")

# What arrays hold, for signatures. Dr.Jit has a class for each precision and backend, so their type is not checked.
PerRay: TypeAlias = Any  #: one entry per ray: a number, a vector or a colour
PerTile: TypeAlias = Any  #: one entry per tile of sixteen rays
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

    `precision`: 'single' (float32) or 'double' (float64). Rays are always cast in float32, the only precision of
    Mitsuba's wheels. Raises InputError if the precision has another name.
    """
    if precision == "single":
        return ArrayTypes(mi.Float, mi.Vector3f, mi.Color3f)
    if precision == "double":
        return ArrayTypes(mi.Float64, mi.Vector3d, mi.Color3d)
    raise InputError(f"precision: got {precision!r}, wanted one of {', '.join(PRECISIONS)}")


def types_of(Float) -> ArrayTypes:
    """Return the array types of the precision of a number type."""
    return array_types("single" if is_single(Float) else "double")


def is_single(Float) -> bool:
    """Return whether a number type is float32; Python's float, the number of the scalar backend, is not."""
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
    """Return an array with the four numbers of every lane side by side, for gathers that read them at once."""
    width = dr.width(numbers)
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
    """Return the value of a number, counted from 0, which may differ between lanes; `values` are arrays of one type."""
    chosen, *others = values
    for place, value in enumerate(others, 1):
        chosen = dr.select(number == place, value, chosen)
    return chosen
