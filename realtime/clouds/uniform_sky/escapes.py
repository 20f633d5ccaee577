# SPDX-License-Identifier: BSD-3-Clause
r"""The share of light paths that leave a slab after a number of scatterings.

Light goes both ways along a path. Under a sky of the radiance L everywhere, below as above, the eye gets of order n

    L albedo^n Pr(a path that starts at the eye is scattered n times and then leaves),

as whatever such a path meets behind the cloud is L. If nothing is absorbed, every path leaves: all orders together are
L times the opacity of the ray, exactly, for a cloud of any shape. So the shape decides only how this light is shared
among the orders.

For a slab of the thickness t and a ray of the cosine mu these shares follow from the equation of transfer with light
entering at both faces, I_0 = exp(-s/|mu|), s the depth from the face where a direction enters, order after order as in
`realtime.clouds.slab_orders`, in the mean over azimuths alone. What is kept is divided by 1 - exp(-t/mu), so that the
shares of all sets add up to 1 at albedo 1.
"""

import hashlib
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from realtime.clouds.order_layers import FIRST_ORDERS
from realtime.clouds.slab_orders.depth_panels import Transport, depth_panels
from realtime.clouds.slab_orders.discrete_ordinates import Eigenmodes
from realtime.clouds.slab_orders.phases import SlabPhase
from realtime.clouds.slab_orders.streams import double_gauss, mode_kernel

Array = NDArray[np.float64]

THINNEST, THICKEST = 1e-3, 400.0  #: optical thickness of the slabs
THICKNESSES, COSINES = 40, 24
_STREAMS = 16
_VERSION = 1  # counts up when numbers change


def thicknesses() -> Array:
    """Return the thicknesses of the table, even in their logarithm."""
    return np.geomspace(THINNEST, THICKEST, THICKNESSES)


def escapes(phase: SlabPhase, albedo: float) -> Array:
    """Return the shares by set of orders, (thicknesses, cosines, sets), cosines even from 0 to 1.

    They are made in some seconds and kept on disk.

    `phase`, `albedo`: of the medium, the albedo in [0, 1].
    """
    made = "escapes", _VERSION, _STREAMS, THINNEST, THICKEST, THICKNESSES, COSINES
    digest = hashlib.blake2b(repr(made).encode(), digest_size=8).hexdigest()
    medium = medium_numbers(phase, albedo)
    arrays = load_kept(digest, medium)
    if arrays is None:
        arrays = {"shares": np.stack([slab_escapes(t, phase, albedo) for t in thicknesses()])}
        keep(digest, medium, arrays)
    return np.asarray(arrays["shares"])


def slab_escapes(tau: float, phase: SlabPhase, albedo: float, *, streams: int = _STREAMS) -> Array:
    """Return the shares of a slab of the thickness `tau`, (cosines, sets); see `escapes`."""
    rule = double_gauss(streams)
    moments = phase.moments(2 * streams + 1)
    peak = float(moments[-1])
    kept = moments[:-1] - peak
    scatter = albedo / 2 * mode_kernel(0, kept, rule.mu, rule.mu) * rule.weights
    scatter += albedo * peak * np.eye(rule.mu.size)
    panels = depth_panels(tau, float(rule.mu[0]) / 2, count=4)
    transport = Transport(panels, rule.mu)
    depths = panels.depths[:, None]
    upward = rule.mu > 0
    field = np.exp(-np.where(upward, tau - depths, depths) / np.abs(rule.mu))
    leaving: list[Array] = []
    for _ in range(FIRST_ORDERS[-1] - 1):
        (field,), (edges,) = transport((field @ scatter.T)[None])
        leaving.append(edges[0, upward])
    modes = Eigenmodes(rule, 0, albedo=albedo, moments=kept, peak=peak)
    (rest,) = modes.all_orders(Transport(panels, modes.cosines), (field @ scatter.T)[None])
    _, (edges,) = transport(((field + rest) @ scatter.T)[None])
    bounds = [first - 1 for first in FIRST_ORDERS]
    sets = [sum(leaving[first:end]) for first, end in pairwise(bounds)] + [edges[0, upward]]
    cosines = rule.mu[upward]
    shares = np.stack(sets, axis=-1) / -np.expm1(-tau / cosines)[:, None]
    wanted = np.linspace(0.0, 1.0, COSINES)
    return np.stack([_along(wanted, cosines, shares[:, number]) for number in range(len(sets))], axis=-1)


def _along(wanted: Array, cosines: Array, values: Array) -> Array:
    """Return values between and beyond the cosines, linear in them."""
    inside = np.interp(wanted, cosines, values)
    ends = ((wanted < cosines[0], 0, 1), (wanted > cosines[-1], -1, -2))
    for beyond, last, next_ in ends:
        slope = (values[last] - values[next_]) / (cosines[last] - cosines[next_])
        inside = np.where(beyond, values[last] + slope * (wanted - cosines[last]), inside)
    return np.maximum(inside, 0.0)
