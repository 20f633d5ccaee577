# SPDX-License-Identifier: BSD-3-Clause
"""Paths from directional lights to camera rays in bounded media.

The leg of a directional light is endless, so that only what has bounds dims it; between the kinks of its lengths
(`reference.quadrature.directional_sums`) the integrand is an exponential of a linear function, and eight nodes are
exact to rounding over up to four optical depths.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.directional_airlight import lit_parallel_rays
from reference.quadrature.directional_sums import kinks
from reference.quadrature.pieces import Crossed, cut_pieces
from reference.scene.directional_light import DirectionalLight
from reference.scene.read import TruthScene
from validation.fog_model.lengths import lengths
from validation.fog_model.nodes import panel_nodes
from validation.fog_model.paths import Nodes

Array = NDArray[np.float64]

_PANEL = 4.0  # optical depths in a panel, at the scene's own extinction
_SHORT = 0.5


def directional_nodes(truth: TruthScene, light: DirectionalLight, distance: Array, how: dict[str, Any]) -> Nodes:
    """Return the nodes of a directional light on the lit parts of all rays; see `point_nodes` for the parameters."""
    rays, lit, segments = lit_parallel_rays(truth, light, distance, how)
    x0, x1 = rays.distance(lit.ray, lit.low), rays.distance(lit.ray, lit.high)
    used = x1 > x0
    stretches = lit.ray[used], x0[used], x1[used]
    setup = Crossed(truth, rays.direction, segments)
    pieces = cut_pieces(setup, stretches, kinks(truth, rays, np.unique(stretches[0])))
    width = pieces.x1 - pieces.x0
    depth = width * setup.by_medium("sigma_t", pieces.medium).max(axis=1)
    owner, share, weight = panel_nodes(np.zeros(len(width)), np.maximum(depth, 1e-300), most=_PANEL, short=_SHORT)
    share, weight = share / np.maximum(depth, 1e-300)[owner], weight / np.maximum(depth, 1e-300)[owner]
    ray, medium = pieces.ray[owner], pieces.medium[owner] + 1
    x = pieces.x0[owner] + width[owner] * share
    direction = truth.direction[ray]
    nothing = np.zeros_like(x)
    return Nodes(
        ray,
        medium,
        x,
        np.ones_like(x),
        rays.cosine[ray],
        weight * width[owner],
        lengths(truth, truth.origin, direction, nothing, x),
        lengths(truth, truth.origin + x[:, None] * direction, -light.direction, nothing, np.full(len(x), np.inf)),
        np.zeros_like(direction),
    )
