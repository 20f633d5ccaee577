# SPDX-License-Identifier: BSD-3-Clause
"""Gamma added up over the crossings of shadow planes one by one, as the paper does it.

The stencil starts with the layers over the visible surface. Planes come towards the camera
(order=paper): one that faces the camera, beyond which there is shadow, adds its Gamma if the
stencil is one and takes its layers off; one that faces away subtracts its Gamma if the stencil is
zero and puts its layers on (Biri 2006, section 5.1.5). From the camera on (order=exact) the same
rule reads: a plane that brings the count from zero up adds, one that brings it back to zero
subtracts. Without an order every plane counts.

**Bounded media** (5.2). A ray is drawn in each medium by itself: its end is the exit from the
medium or the surface before that, whose Gamma is added if it is lit. The entry, a back facing
triangle of the bounds in the paper, is drawn in the order of the planes. It subtracts its Gamma if
the stencil is zero, and sets the stencil to 255: planes closer to the camera do not pass. For
order=paper an entry therefore has a place by the cosine of the angle at the light between the
camera and itself, planes of a larger cosine are left out, and the entry comes last. The paper asks
for small triangles, whose middles stand for them in the order: here they are points. In the other
orders the planes behind the entry count.

**The frame buffer** holds the frame, not one sum: `start` is its content before.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.published.biri2006.planes import PaperPlanes
from airlight.realtime.methods.shadow_planes.plane_table import PlaneIndex
from airlight.realtime.methods.shadow_planes.sweep import RayPlanes, read_plane


@dataclass(frozen=True)
class Buffer:
    """A frame buffer of 8 bits a channel."""

    white: float  #: radiance that fills it [W/(m^2 sr)]

    def stored(self, value):
        """Return a radiance `value` as the buffer keeps it [W/(m^2 sr)]."""
        return dr.round(dr.clip(value, 0, self.white) * (255 / self.white)) * (self.white / 255)


@dataclass(frozen=True)
class Entry:
    """Where rays enter a bounded medium."""

    distance: Any  #: from the camera; 0 for one within [m]
    gamma: Any  #: the radiance of Gamma there


@dataclass
class _Draw:
    """Progress in drawing the planes of a ray."""

    place: Any  #: next entry to read
    stencil: Any  #: layers of shadow so far
    quotient: Any  #: D/x of the plane to draw
    number: Any  #: of the plane to draw
    factor: Any  #: how often it counts; 0 if none is ready
    total: Any  #: the radiance so far [W/(m^2 sr)]


def sum_crossings(
    planes: PaperPlanes,
    ray: RayPlanes,
    distance,
    gammas,
    *,
    order: str,
    buffer: Buffer | None,
    start=None,
    entry: Entry | None = None,
):
    """Add up Gamma over the crossings of every ray.

    Parameters
    ----------
    planes, ray
        The planes and the rays.
    distance
        To the visible surface, or to the end in a bounded medium [m].
    gammas
        Functions (plane, ray, x) and (x) that give the radiance of Gamma at a crossing and at the
        surface [W/(m^2 sr)].
    order
        'exact', 'paper' or 'none'.
    buffer
        The buffer that holds the sum; None for float.
    start
        The content of the buffer before, or None.
    entry
        Where rays enter a bounded medium, or None.

    Returns
    -------
    total
        The radiance [W/(m^2 sr)].
    lit
        Whether the light reaches the end.
    """
    index = planes.index
    at_plane, at_surface = gammas
    ray_end = index.distance / distance
    width = dr.width(ray.x)
    Float = type(ray.x)
    # The stencil starts with the layers over the visible surface, whose Gamma is added if no layer
    # covers it.
    over_surface = _layers_at_end(index, ray, ray_end)
    lit = over_surface <= 0
    keep = buffer.stored if buffer else lambda value: value
    at_end = dr.select(lit, at_surface(distance), 0)
    total = keep(at_end if start is None else start + at_end)
    key = None if entry is None else _entry_key(index, ray, entry, order)
    # Planes come from the surface towards the camera, or in the exact order from the camera on,
    # where `index.layers` are between the light and the camera.
    begin = Float(index.layers) + dr.zeros(Float, width) if order == "exact" else over_surface
    draw = _Draw(
        dr.zeros(mi.UInt32, width),
        begin,
        dr.zeros(Float, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(Float, width),
        total,
    )

    # Each ray reads on until it has a plane that counts; then all rays evaluate Gamma together.
    def body(draw):
        (draw,) = dr.while_loop(
            state=(draw,),
            cond=lambda draw: (draw.factor == 0) & (draw.place < ray.count),
            body=lambda draw: (_next(planes, ray, ray_end, draw, order, key),),
            labels=("draw",),
        )
        # x = D/quotient; a ray at the end of its list has no plane ready, and adds nothing.
        x = dr.minimum(
            index.distance / dr.select(draw.factor == 0, index.distance, draw.quotient), distance
        )
        value = at_plane(draw.number, ray, x)
        draw.total = dr.select(draw.factor == 0, draw.total, keep(draw.total + draw.factor * value))
        draw.factor = Float(0)
        return (draw,)

    (draw,) = dr.while_loop(
        state=(draw,), cond=lambda draw: draw.place < ray.count, body=body, labels=("draw",)
    )
    if entry is None:
        return draw.total, lit
    # The entry is drawn last: in the paper's order the stencil says whether it is lit, in the exact
    # order the layers at the entry. Without an order it always counts.
    enters: Any = mi.Bool(True)
    if order == "paper":
        enters = draw.stencil == 0
    elif order == "exact":
        enters = _layers_at_end(index, ray, index.distance / entry.distance) <= 0
    return keep(draw.total - dr.select(enters, entry.gamma, 0)), lit


def reaches(index: PlaneIndex, ray: RayPlanes, distance):
    """Return whether the light reaches the points of rays at a distance [m]."""
    return _layers_at_end(index, ray, index.distance / distance) <= 0


def _entry_key(index: PlaneIndex, ray: RayPlanes, entry: Entry, order: str):
    """Return the key of an entry, which planes are compared with: -cos of the angle at the light
    in the paper's order, D/x in the other orders.
    """
    if order != "paper":
        return index.distance / entry.distance
    # The entry is x w from the camera, which is at D on the z axis.
    x, z = entry.distance, ray.z
    along = dr.fma(x, z, index.distance)
    beside = x * dr.sqrt(dr.maximum(dr.fma(-z, z, 1), 0))
    return -along * dr.rsqrt(dr.fma(along, along, beside * beside))


def _next(
    planes: PaperPlanes, ray: RayPlanes, ray_end, draw: _Draw, order: str, entry_key
) -> _Draw:
    """Read the next plane of the list."""
    # D/x is larger before the end of the ray.
    quotient, crossed, gain, number = read_plane(
        planes.index, ray, draw.place, draw.place < ray.count
    )
    crossed &= quotient > ray_end
    # In the paper's order an entry leaves out planes of a larger cosine. In the other orders planes
    # before the entry change the stencil, but do not count.
    counts = crossed
    if entry_key is not None and order == "paper":
        crossed &= -dr.gather(type(ray.x), planes.centres, number, crossed) > entry_key
        counts = crossed
    elif entry_key is not None:
        counts = crossed & (quotient < entry_key)
    if order == "none":
        factor, stencil = gain, draw.stencil
    elif order == "paper":
        # Coming from the surface: beyond a plane with a gain there is shadow. It adds its Gamma if
        # the stencil is one, and takes its layers off; a loss subtracts if the stencil is zero.
        passes = dr.select(gain > 0, draw.stencil == 1, draw.stencil == 0)
        factor = dr.select(passes, dr.sign(gain), 0)
        stencil = draw.stencil - gain
    else:
        # Coming from the camera: the plane that begins a shadow adds, the plane that ends it
        # subtracts.
        stencil = draw.stencil + gain
        begins, ends = (draw.stencil <= 0) & (stencil > 0), (draw.stencil > 0) & (stencil <= 0)
        factor = dr.select(begins, 1, dr.select(ends, -1, 0))
    return _Draw(
        draw.place + 1,
        dr.select(crossed, stencil, draw.stencil),
        quotient,
        number,
        dr.select(counts, type(gain)(factor), 0),
        draw.total,
    )


def _layers_at_end(index: PlaneIndex, ray: RayPlanes, ray_end):
    """Return the layers over the visible surface."""
    # Layers at the camera, and the gains of all planes before the end, in any order.
    Float, width = type(ray.x), dr.width(ray.x)

    def look(k, layers):
        quotient, crossed, gain, _ = read_plane(index, ray, k, k < ray.count)
        return layers + dr.select(crossed & (quotient > ray_end), gain, 0)

    _, layers = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), dr.zeros(Float, width) + Float(index.layers)),
        cond=lambda k, layers: k < ray.count,
        body=lambda k, layers: (k + 1, look(k, layers)),
        labels=("k", "layers"),
    )
    return layers
