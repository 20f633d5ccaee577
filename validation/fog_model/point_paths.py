# SPDX-License-Identifier: BSD-3-Clause
"""Paths from point and spot lights, and from points of lights with extent, to camera rays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.bounded import smooth_pieces
from reference.quadrature.light_airlight import lit_rays
from reference.quadrature.pieces import Setup
from reference.quadrature.unbounded import lit_stretches
from reference.scene.read import TruthLight, TruthScene
from reference.visibility.spot_cone import falloff
from validation.fog_model.lengths import lengths
from validation.fog_model.nodes import panel_nodes
from validation.fog_model.paths import AROUND, Nodes

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_NOTHING_LEFT = 40.0  # optical depth after which e^-40 = 4e-18 of the light is left
_THINNEST = 1 / 30  # share of the scene's extinction down to which endless rays are long enough
_AT_LIGHT = 1e-290  # height [m] below which a ray meets the light
_OF_ONE, _OF_MANY = (8, 4), (4, 2)  # nodes on a panel and on a short one: of a light, of a point on one with extent
_NEAR_ZERO = 1e-15  # height over distance below which a light beside a piece may as well be at this height


def point_nodes(
    truth: TruthScene, light: TruthLight, distance: Array, how: dict[str, Any], begin: Array | None = None
) -> Nodes:
    """Return the nodes of a point or spot light on the lit parts of all rays.

    Parameters
    ----------
    light
        The light; its intensity is left out.
    distance
        To the visible surface, (rays,) [m].
    how
        What `reference.visibility.lit_intervals.lit_intervals` takes.
    begin
        Distance before which a ray has no nodes, (rays,) [m].
    """
    reach = lit_rays(truth, light, distance, how)
    rays = reach.rays
    ray, x0, x1 = lit_stretches(light, rays, reach.lit)
    if begin is not None:
        x0 = np.maximum(x0, begin[ray])
    used = x1 > x0
    ray, x0, x1 = ray[used], x0[used], x1[used]
    if reach.segments is None:
        medium = np.full(len(ray), AROUND)
        x1 = np.where(np.isinf(x1), np.maximum(x0, rays.foot[ray]) + _reach(truth), x1)
    else:
        setup = Setup(truth, rays.direction, reach.segments, light, rays, 1.0, reach.lit.edge)
        pieces, _ = smooth_pieces(setup, (ray, x0, x1))
        # The truth counts media with bounds from 0 and calls what surrounds them -1.
        ray, x0, x1, medium = pieces.ray, pieces.x0, pieces.x1, pieces.medium + 1
    foot, s0, s1 = rays.foot[ray], x0 - rays.foot[ray], x1 - rays.foot[ray]
    beside = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
    height = np.maximum(rays.height[ray], np.maximum(_NEAR_ZERO * beside, _AT_LIGHT))
    start = np.arcsinh(s0 / height)
    orders = _OF_MANY if light.cosine else _OF_ONE
    owner, w, weight = panel_nodes(start, np.arcsinh(s1 / height) - start, orders=orders)
    ray, foot, height, medium = ray[owner], foot[owner], height[owner], medium[owner]
    sine, r = np.tanh(w), height * np.cosh(w)
    x = foot + height * np.sinh(w)
    profile = np.ones_like(x)
    if light.is_soft:
        profile = falloff(np.arcsin(sine)[:, None], rays.direction[ray], rays.normal[ray], light)[:, 0]
    towards = sine[:, None] * rays.direction[ray] + (1 / np.cosh(w))[:, None] * rays.normal[ray]
    return Nodes(
        ray,
        medium,
        x,
        r,
        -sine,
        weight * r * profile,
        lengths(truth, truth.origin, truth.direction[ray], np.zeros_like(x), x),
        lengths(truth, light.position, towards, np.zeros_like(x), r),
        towards,
    )


def _reach(truth: TruthScene) -> float:
    """Return how far behind its foot point an endless ray is followed [m]."""
    sigma_t = truth.medium.sigma_t
    return float(_NOTHING_LEFT / (_THINNEST * sigma_t[sigma_t > 0].min())) if np.any(sigma_t > 0) else 0.0
