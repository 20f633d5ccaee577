# SPDX-License-Identifier: BSD-3-Clause
"""The result of a user method, converted to a colour for every pixel or refused."""

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.errors import InputError
from realtime.methods.interface.method import Layers, View

_WANTED = "wanted the radiance of every pixel, an RGB colour or one number: a Dr.Jit array, or NumPy's (pixels, 3)"


def checked_radiance(returned: Any, view: View, name: str):
    """Return the radiance of every pixel as a colour in the precision of the view.

    Parameters
    ----------
    returned
        The result of the method `name`: a Dr.Jit colour, three-vector or number, or an array (pixels, 3) or (pixels,)
        of another kind, which goes through NumPy; one entry per pixel of `view`, or one for all.
    view
        The view that the method was given.
    name
        The method's name, for messages.

    Raises
    ------
    InputError
        For a result of another type or shape.
    """
    Color, Float = type(view.medium.albedo), type(view.distance)
    width = dr.width(view.pixel)
    channels = _dr_channels(returned, name) if dr.is_array_v(returned) else _channels(returned, width, name)
    for channel in channels:
        if dr.width(channel) not in (1, width):
            raise InputError(f"method {name}: returned {dr.width(channel)} values for {width} pixels; {_WANTED}")
    # A constant has one entry: every pixel gets it.
    return Color(*(Float(channel) + dr.zeros(Float, width) for channel in channels))


def checked_layers(returned: Any, view: View, name: str, *, visibility: bool) -> Layers:
    """Return the layers of a method, their in-scattered radiance as `checked_radiance` does.

    Parameters
    ----------
    returned
        The result of the method `name`.
    view
        The view that it was given.
    name
        Its name, for messages.
    visibility
        Whether it says that it provides the visibility of its lights.

    Raises
    ------
    InputError
        For an object other than `Layers`, radiance of another type or shape, and a visibility that lacks a light.
    """
    if not isinstance(returned, Layers):
        raise InputError(
            f"method {name}: returned a {type(returned).__name__}; wanted realtime.methods.interface.method.Layers"
        )
    fractions = 0 if returned.visibility is None else len(returned.visibility)
    wanted = len(view.lights) if visibility else 0
    if fractions != wanted or (returned.visibility is None) == visibility:
        raise InputError(
            f"method {name}: returned the visibility of {fractions} lights, wanted that of {wanted}: one for each "
            "light where `provides_visibility`, otherwise None"
        )
    return replace(returned, in_scattered=checked_radiance(returned.in_scattered, view, name))


def _dr_channels(returned: Any, name: str) -> tuple[Any, ...]:
    """Return the three channels of a Dr.Jit array."""
    kind = type(returned)
    if dr.is_float_v(kind) and not dr.is_special_v(kind) and not dr.is_tensor_v(kind):
        if dr.depth_v(kind) == 1:
            return (returned,) * 3
        if dr.depth_v(kind) == 2 and len(returned) == 3:
            return tuple(returned)
    raise InputError(f"method {name}: returned a {kind.__module__}.{kind.__name__}; {_WANTED}")


def _channels(returned: Any, width: int, name: str) -> tuple[Any, ...]:
    """Return the three channels of an array of another kind, or of a number."""
    try:
        values = np.asarray(returned)
        right = values.dtype.kind in "fiu"
    except (TypeError, ValueError):
        right = False
    if not right:
        raise InputError(f"method {name}: returned a {type(returned).__name__}; {_WANTED}")
    if values.ndim == 0:
        return (float(values),) * 3
    if values.shape not in ((width,), (width, 3)):
        raise InputError(f"method {name}: returned an array of shape {values.shape} for {width} pixels; {_WANTED}")
    double = np.ascontiguousarray(values, dtype=np.float64)
    return (mi.Float64(double),) * 3 if double.ndim == 1 else tuple(mi.Float64(column) for column in double.T.copy())
