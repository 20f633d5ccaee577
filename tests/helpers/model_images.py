# SPDX-License-Identifier: BSD-3-Clause
"""Images of the equation of a model by a march: its airlight, and its surfaces from the same terms.

It shares the reading of scene and model with the reference, and Mitsuba's materials and shadow
rays.
"""

import numpy as np

from airlight.reference.quadrature.surface import Reflection, surface_hits
from airlight.reference.scene.directional_light import DirectionalLight
from tests.helpers.model_march import (
    _sun_depth,
    _visible,
    depth_between,
    ends_of,
    law,
    marched,
    spot_edge,
    window,
)


def model_image(reference, steps=1024, shadows=True):
    """Return airlight and surface of a scene in its equation, (2, height, width, 3)."""
    hits = surface_hits(reference)
    airlight = marched(reference, hits.distance, steps, shadows)
    layers = airlight, _surfaces(reference, hits, shadows)
    return np.stack(layers).reshape(2, reference.height, reference.width, 3)


def _surfaces(reference, hits, shadows):
    """Return the light of surfaces that point and spot lights and suns light, (rays, 3)."""
    model, total = reference.model, np.zeros((len(reference.direction), 3))
    ray = np.flatnonzero(np.isfinite(hits.distance))
    if not len(ray):
        return total
    point = reference.origin + hits.distance[ray, None] * reference.direction[ray]
    start, end, steps, _ = (part[ray] for part in ends_of(reference, hits.distance))
    of_camera, of_light = model.surface_paths
    first, last = (reference.origin + x[:, None] * reference.direction[ray] for x in (start, end))
    depth = (of_camera * steps)[:, None] * depth_between(reference, first, last - first)
    if model.constant is not None and model.most < 1:
        depth = np.minimum(depth, -np.log(1 - model.most))
    for light in (*reference.lights, *reference.directional):
        if isinstance(light, DirectionalLight):
            way, r = np.broadcast_to(-light.direction, point.shape), np.full(len(ray), np.inf)
            sent = light.irradiance * np.ones((len(ray), 1))
            before = _sun_depth(reference, point, way) if of_light else 0.0
        else:
            way = light.position - point
            before = depth_between(reference, point, way)
            r = np.linalg.norm(way, axis=1)
            way = way / r[:, None]
            falls = law(model.law_of(surface=True), r) * window(model.range_of, r)
            if light.axis is not None:
                falls = falls * spot_edge(model, light, -(way @ light.axis))
            sent = light.intensity * falls[:, None]
        lit = _visible(reference, point, way, r)[:, None] if shadows else 1.0
        left = np.exp(-depth - of_light * before)
        total[ray] += Reflection(hits.interaction)(ray, way) * sent * left * lit
    return model.factors[2] * total
