# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of a light volume: a signed sum over the crossings of camera rays with its boundary.

With J(x) the airlight of a lit ray up to x, a ray has the airlight sum_k s_k J(x_k), s = +1 where it leaves the light
and -1 where it enters it (Billeter, Sintorn, Assarsson 2010, eq. 3). The order does not matter. The visible surface is
at D, and crossings behind it count as crossings at D.
"""

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.interface.method import View
from realtime.methods.light_volumes.published.mesh import VolumeMesh
from realtime.methods.light_volumes.published.raster import BATCH, Crossings, signed_crossings
from realtime.rays import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.media.medium import LitRays


def crossing_sum(batches: Iterable[Crossings], airlight: LitRays, distance, *, lane: Any = None) -> Any:
    """Return J along the lit parts of rays, the signed sum over their crossings [1/m].

    `batches`: from `realtime.methods.light_volumes.published.raster.signed_crossings`; `airlight`, `distance`: the rays
    with the light, whose cone clips every crossing, and the distances to the visible surface [m]; `lane`: by pixel
    number its entry among the rays; None where they are in the order of the image.

    Valid for a closed mesh. With eq. 3 as it stands, every crossing beyond the light has the large airlight about the
    light, and what rounding leaves of it where they cancel is visible. As J(0, x) = J(0, D) - J(x, D), the sum is also

        n J(0, D) + sum_{x_k < foot} s_k J(0, x_k) - sum_{foot <= x_k < D} s_k J(x_k, D),

    with n the sum of the signs of the crossings at or beyond the foot, or at the surface: a whole number, 1 where the
    point next to the light is lit and 0 where it is not. No other term contains the airlight about the light, and
    crossings at the surface cost nothing. Terms have the precision of the rays and are added up in float64.
    """
    Float, geometry = type(distance), airlight.geometry
    zero = airlight.nothing(1)
    total = dr.zeros(mi.Color3d if dr.depth_v(zero) > 1 else mi.Float64, dr.width(distance))
    beyond = dr.zeros(mi.Float64, dr.width(distance))

    def add(index, x0, x1, sign):
        dr.eval(index, x0, x1, sign)  # All calls then share one kernel; compiling it takes longer than running it.
        columns = (getattr(geometry, field.name) for field in fields(RayGeometry))
        rays = RayGeometry(*(None if column is None else dr.gather(Float, column, index) for column in columns))
        term = replace(airlight, geometry=rays).airlight(x0, x1)
        dr.scatter_add(total, type(total)(term) * sign, index)
        dr.eval(total)

    for crossings in batches:
        index = crossings.pixel if lane is None else dr.gather(mi.UInt32, lane, crossings.pixel)
        x, sign = Float(crossings.distance), crossings.sign
        in_front = x < dr.gather(Float, distance, index)
        is_beyond = ~in_front | (x >= dr.gather(Float, geometry.foot, index))
        dr.scatter_add(beyond, sign, index, is_beyond)
        dr.eval(beyond, index, x, sign, in_front)
        some = dr.compress(in_front)
        if dr.width(some) == 0:
            continue
        index, x, sign = (dr.gather(type(values), values, some) for values in (index, x, sign))
        near = x < dr.gather(Float, geometry.foot, index)
        end = dr.select(near, x, dr.gather(Float, distance, index))
        add(index, dr.select(near, 0, x), end, dr.select(near, sign, -sign))
    whole = dr.compress(beyond != 0)
    if dr.width(whole):
        camera = dr.opaque(Float, 0, dr.width(whole))
        add(whole, camera, dr.gather(Float, distance, whole), dr.gather(mi.Float64, beyond, whole))
    return type(zero)(total)


def mesh_airlight(view: View, light: Light, mesh: VolumeMesh, *, kernel, batch: int = BATCH):
    """Return the airlight of one light by the triangles of its light volume [W/(m^2 sr)].

    `view`: the frame; its rays are those of all pixels of its camera; `light`: the light; `mesh`: its light volume,
    closed; `kernel`: an airlight kernel function; `batch`: see
    `realtime.methods.light_volumes.published.raster.signed_crossings`.

    Valid for homogeneous media that fill all space. The number of crossings is counted on the way: not for a frozen
    function.

    Billeter, Sintorn, Assarsson 2010, eq. 3.
    """
    airlight = view.lit_by(light, kernel)
    lane = dr.zeros(mi.UInt32, view.camera.width * view.camera.height)
    dr.scatter(lane, dr.arange(mi.UInt32, dr.width(view.pixel)), view.pixel)
    distance = view.distance
    dr.eval(airlight.geometry, lane, distance)  # every crossing reads them
    crossings = signed_crossings(mesh, view.camera, batch=batch)
    return airlight.radiance(crossing_sum(crossings, airlight, distance, lane=lane))
