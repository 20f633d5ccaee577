# SPDX-License-Identifier: BSD-3-Clause
"""The light that clouds scatter from a sky that is the same everywhere, by order of scattering.

**The fraction of light paths that leave a slab after a number of scatterings.**

Light goes both ways along a path. Under a sky of the radiance L everywhere, below as above, the
light of order n that reaches the eye is

    L albedo^n Pr(a path that starts at the eye is scattered n times and then leaves),

as whatever such a path meets behind the cloud is L. If nothing is absorbed, every path leaves: all
orders together are L times the opacity of the ray, exactly, for a cloud of any shape. The shape
therefore decides only how this light is divided among the orders.

For a slab of the thickness t and a ray of the cosine mu these fractions follow from the equation of
transfer with light entering at both faces, I_0 = exp(-s/|mu|), s the depth from the face where a
direction enters. Orders are computed one after the other as in `realtime.clouds.slab_orders`, but
only their mean over the azimuths. The fractions are divided by 1 - exp(-t/mu), so that they add up
to 1 over all sets at albedo 1.

**The light that clouds scatter from a uniform sky into rays, by set of orders.**

A ray of the depth T in clouds, under a sky of the radiance L, gets L (1 - exp(-T)) from all orders
together where nothing is absorbed: as much as the clouds take from the sky behind. The section
above says why, and how a slab divides it among the orders. The slab that stands for the cloud has
its face where the ray first meets the cloud, with the cosine mu between ray and normal there. Its
thickness is t = mu T, through which the ray has the same depth T, but at most 2 V/S: a slab of that
thickness has the mean chord 4 V/S of a cloud of the volume V and the surface S, as light leaves a
body to all sides. A camera in a cloud looks across its slab.

With absorption the slab gives the sum, too. Opaque shapes hide the same fraction of the sky from
all orders: they block some of eight directions from the place of entry.
"""

import hashlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.clouds.canonical.coordinates import FIRST_ORDERS, ORDER_LAYERS, slab_phase
from airlight.realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from airlight.realtime.clouds.single_scattering import CloudRays, opacity_of
from airlight.realtime.clouds.slab_orders.depth_panels import Transport, depth_panels
from airlight.realtime.clouds.slab_orders.discrete_ordinates import (
    Eigenmodes,
    double_gauss,
    mode_kernel,
)
from airlight.realtime.clouds.slab_orders.phases import SlabPhase
from airlight.realtime.numerics.array_types import types_of
from airlight.realtime.numerics.functions import between_entries
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded import Clouds
from airlight.realtime.scene.mesh_adjacency import mesh_triangles
from airlight.realtime.scene.read_scene import Scene

Array = NDArray[np.float64]

THINNEST, THICKEST = 1e-3, 400.0  #: optical thickness of the slabs
THICKNESSES, COSINES = 40, 24
_STREAMS = 16


def thicknesses() -> Array:
    """Return the thicknesses of the table, even in their logarithm."""
    return np.geomspace(THINNEST, THICKEST, THICKNESSES)


def escapes(phase: SlabPhase, albedo: float) -> Array:
    """Return the fractions by set of orders, (thicknesses, cosines, sets),
    cosines even from 0 to 1.

    They take some seconds, once: the disk caches them.

    `phase`, `albedo`: of the medium, the albedo in [0, 1].
    """
    version = 1  # counts up when numbers change
    inputs = "escapes", version, _STREAMS, THINNEST, THICKEST, THICKNESSES, COSINES
    digest = hashlib.blake2b(repr(inputs).encode(), digest_size=8).hexdigest()
    medium = medium_numbers(phase, albedo)
    arrays = load_kept(digest, medium)
    if arrays is None:
        arrays = {"fractions": np.stack([slab_escapes(t, phase, albedo) for t in thicknesses()])}
        keep(digest, medium, arrays)
    return np.asarray(arrays["fractions"])


def slab_escapes(tau: float, phase: SlabPhase, albedo: float) -> Array:
    """Return the fractions of a slab of the thickness `tau`, (cosines, sets); see `escapes`."""
    from scipy.interpolate import make_interp_spline

    # Scattering between the streams in mode 0, with the peak that goes on in its stream.
    rule = double_gauss(_STREAMS)
    moments = phase.moments(2 * _STREAMS + 1)
    peak = float(moments[-1])
    resolved = moments[:-1] - peak
    scatter = albedo / 2 * mode_kernel(0, resolved, rule.mu, rule.mu) * rule.weights
    scatter += albedo * peak * np.eye(rule.mu.size)
    # I_0: upward light enters at the bottom, the other light at the top.
    panels = depth_panels(tau, float(rule.mu[0]) / 2, count=4)
    transport = Transport(panels, rule.mu)
    depths = panels.depths[:, None]
    upward = rule.mu > 0
    field = np.exp(-np.where(upward, tau - depths, depths) / np.abs(rule.mu))
    # Orders 1, 2, .. one by one, and their radiance at the top, which is the same at the bottom.
    leaving: list[Array] = []
    for _ in range(FIRST_ORDERS[-1] - 1):
        (field,), (edges,) = transport((field @ scatter.T)[None])
        leaving.append(edges[0, upward])
    # All later orders at once, and once more through the slab for their radiance at the top.
    modes = Eigenmodes(rule, 0, albedo=albedo, moments=resolved, peak=peak)
    (rest,) = modes.all_orders(Transport(panels, modes.cosines), (field @ scatter.T)[None])
    _, (edges,) = transport(((field + rest) @ scatter.T)[None])
    # From orders to sets; the first entry of `leaving` is order 1.
    bounds = [first - 1 for first in FIRST_ORDERS]
    sets = [sum(leaving[first:end]) for first, end in pairwise(bounds)] + [edges[0, upward]]
    # In fractions of the light that the slab takes out of a ray.
    cosines = rule.mu[upward]
    fractions = np.stack(sets, axis=-1) / -np.expm1(-tau / cosines)[:, None]
    # Linear between the cosines and beyond them.
    line = make_interp_spline(cosines, fractions, k=1)
    return np.maximum(line(np.linspace(0.0, 1.0, COSINES)), 0.0)


#: (point [m], light) -> whether no opaque shape is between them.
Visible = Callable[[Any, Light], Any]


@dataclass(frozen=True)
class SkyEscapes:
    """The fractions of light paths that leave a slab, on the device."""

    fractions: Any  #: medium after medium, (thicknesses, cosines, sets)
    media: tuple[Any, ...]  #: by channel, the number of the medium that fills each cloud
    widths: Any  #: by cloud, 2 V/S [m]


def beams_of(lights: Sequence[Light], sky: str, clouds: Clouds) -> list[int]:
    """Return the numbers of the lights that shine from one direction: all, or
    all but a 'uniform' `sky`.

    No slab stands for a cloud whose density differs from place to place: its sky is a beam.
    """
    uniform = sky == "uniform" and clouds.density is None
    return [number for number, light in enumerate(lights) if light.sky is None or not uniform]


def sky_escapes(scene: Scene) -> SkyEscapes:
    """Return the fractions of all media of the clouds of a scene; made once."""
    clouds, types = scene.medium.clouds, types_of(type(scene.camera.origin.x))
    assert clouds is not None
    # Clouds with one phase function and one albedo, in any channel, share a table.
    phases = np.array(clouds.phase)
    albedos = np.array(clouds.albedo, dtype=np.float64).reshape(3, -1)
    filled = [
        [(int(phase), float(albedo)) for phase, albedo in zip(phases, row)] for row in albedos
    ]
    media = sorted({medium for row in filled for medium in row})
    slab_phases = [slab_phase(phase, types) for phase in clouds.phases]
    tables = np.concatenate(
        [escapes(slab_phases[phase], albedo).ravel() for phase, albedo in media]
    )
    # The tables one after the other; by channel, each cloud has the number of its medium.
    escaping = SkyEscapes(
        types.scalar(tables),
        tuple(mi.UInt32([media.index(medium) for medium in row]) for row in filled),
        types.scalar([_slab_width(shape) for shape in scene.boundaries]),
    )
    dr.make_opaque(escaping)
    return escaping


def sky_light(
    escaping: SkyEscapes, light: Light, rays: CloudRays, visible: Visible | None
) -> tuple[Any, ...]:
    """Return the light of a sky by set of orders, colours, in the order of
    `ORDER_LAYERS` [W/(m^2 sr)].

    `escaping`: from `sky_escapes`; `light`: the sky; `rays`: through the clouds as they are;
    `visible`: (point [m], light) -> whether no opaque shape is between them; None where nothing
    casts a shadow.
    """
    Float, Color = type(rays.direction.x), type(light.sky)
    first = rays.first
    # A camera in a cloud looks across its slab.
    mu = dr.select(first.leaves, 1, dr.minimum(dr.abs(dr.dot(first.normal, rays.direction)), 1))
    # t = mu T, at most 2 V/S; grey media have one depth for all three channels.
    by_channel = []
    for channel in range(3):
        depth = rays.depths[min(channel, len(rays.depths) - 1)]
        sigma_t = dr.gather(
            Float, rays.clouds.sigma_t[min(channel, len(rays.depths) - 1)], first.cloud
        )
        thickness = dr.minimum(depth * mu, sigma_t * dr.gather(Float, escaping.widths, first.cloud))
        medium = dr.gather(mi.UInt32, escaping.media[channel], first.cloud)
        by_channel.append(_fractions(escaping.fractions, medium, thickness, mu))
    # L (1 - exp(-T)), less what opaque shapes hide at the place of entry, or at the camera in a
    # cloud.
    radiance = light.sky * opacity_of(rays.depths, Color)
    if visible is not None:
        begin = dr.select(first.leaves | ~dr.isfinite(first.distance), 0, first.distance)
        radiance *= _seen_fraction(light, rays.origin + rays.direction * begin, visible)
    return tuple(radiance * Color(*parts) for parts in zip(*by_channel))


def _slab_width(shape: Any) -> float:
    """Return 2 V/S of a shape [m]."""
    # 2 V/S of a sphere is a third of its diameter.
    if not shape.is_mesh():
        return float(np.max(np.array(shape.bbox().max) - np.array(shape.bbox().min))) / 3
    vertices, faces = mesh_triangles(shape)
    a, b, c = np.moveaxis((vertices - vertices.mean(axis=0))[faces], 1, 0)
    # V = |sum of a . area|/3 over all triangles, corners counted from the middle of the mesh, and S
    # the sum of their areas.
    areas = np.cross(b - a, c - a) / 2
    return float(2 * abs(np.sum(a * areas)) / 3 / np.linalg.norm(areas, axis=1).sum())


def _seen_fraction(light: Light, point: Any, visible: Visible) -> Any:
    """Return the fraction of the sky that points see past opaque shapes [1]."""
    Float = type(point.x)
    # Eight directions, to the corners of a cube, stand for the whole sky.
    corners = itertools.product((-1, 1), repeat=3)
    axes = [mi.Vector3d(*(sign * (1 / 3) ** 0.5 for sign in corner)) for corner in corners]
    visibilities = [
        dr.select(visible(point, replace(light, exact_axis=axis)), Float(1), 0) for axis in axes
    ]
    return sum(visibilities) / len(visibilities)


def _fractions(table: Any, medium: Any, thickness: Any, mu: Any) -> list[Any]:
    """Return the fractions of all sets, linear in the logarithm of the thickness and in mu."""
    along = dr.log(dr.clip(thickness, THINNEST, THICKEST) / THINNEST) / np.log(THICKEST / THINNEST)
    sets = len(ORDER_LAYERS)
    return between_entries(table, [(along, THICKNESSES), (mu, COSINES)], sets, first=medium)
