# SPDX-License-Identifier: BSD-3-Clause
"""The equation of a model, marched in NumPy from what `reference.scene.model` says of its terms.

It shares the reading of scene and model with the reference and nothing else: midpoints of equal
steps of asinh((x - foot)/height) for lamps, and of log(1 + x) for suns, and shadow rays of Mitsuba.
"""

import mitsuba as mi
import numpy as np

from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.varying import HeightMedium

STEPS = 4096


def marched(reference, distance, steps=STEPS, shadows=True):
    """Return the airlight of a scene for its model, (rays, 3); `distance`: to surfaces, (rays,)."""
    model, total = reference.model, np.zeros((len(reference.direction), 3))
    start, end, factor, camera = ends_of(reference, distance)
    if model.constant is None:
        for light in (*reference.lights, *reference.directional):
            sun = isinstance(light, DirectionalLight)
            strength = (
                light.irradiance * float(model.suns)
                if sun
                else light.intensity * float(model.lamps)
            )
            total += strength * _of_light(reference, light, start, end, camera, steps, shadows)
        total *= factor[:, None]
        if model.lit_scale is not None:
            total = 1 - np.exp(-model.lit_scale * total)
    depth = marched_depth(reference, start, end, steps) * camera[:, None]
    if model.ambient_of is not None:
        albedo = reference.medium.albedo
        whole = np.where(
            camera[:, None] > 0,
            (1 - np.exp(-depth)) / np.where(camera > 0, camera, 1)[:, None],
            marched_depth(reference, start, end, steps),
        )
        total += np.array(model.ambient_of) * albedo * whole * factor[:, None]
    if model.constant is not None:
        total += np.array(model.constant) * np.minimum(1 - np.exp(-depth), model.most)
        if model.lobe_of is not None:
            begin = np.full_like(start, model.lobe_of.start)
            last = np.where(end > start, np.maximum(end, begin), begin)
            own = 1 - np.exp(-camera[:, None] * marched_depth(reference, begin, last, steps))
            for sun in reference.directional:
                cosine = np.maximum(-(reference.direction @ sun.direction), 0)
                total += (cosine**model.lobe_of.power)[:, None] * sun.irradiance * own
    return total


def ends_of(reference, distance):
    """Return where the fog of rays begins and ends, the factor of planar steps, and the fraction of
    the depth to the camera, (rays,) each.
    """
    model, cosine = reference.model, reference.direction @ reference.axis
    end = {"axis-ends": distance * cosine, "axis-lookup": distance / cosine}.get(
        model.depth, distance
    )
    along = cosine if model.ends_of.planes else np.ones_like(cosine)
    planar = cosine if model.depth == "axis" else np.ones_like(cosine)
    start = model.ends_of.near / along
    end = np.maximum(np.minimum(end, model.ends_of.far / along), start)
    return start, end, planar, model.camera_scale * planar


def density(reference, point):
    """Return the extinction at points, (.., 3) or (.., 1)."""
    medium = reference.medium
    if not isinstance(medium, HeightMedium):
        return np.broadcast_to(medium.sigma_t, (*point.shape[:-1], 3))
    z, total = point @ medium.up, np.full(point.shape[:-1], float(medium.constant))
    for sigma_t, base, scale in medium.layers:
        above = np.maximum(z - base, 0) if medium.clamped else z - base
        total = total + sigma_t * np.exp(-np.minimum(above / scale, 700))
    return (total * ((z >= medium.floor) & (z <= medium.cap)))[..., None]


def depth_between(reference, point, way, nodes=33):
    """Return the depth of segments from points along ways, by Simpson's rule."""
    if not isinstance(reference.medium, HeightMedium):
        return np.linalg.norm(way, axis=-1)[..., None] * reference.medium.sigma_t
    weights = np.ones(nodes)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    total = sum(
        w * density(reference, point + t * way)
        for w, t in zip(weights / weights.sum(), np.linspace(0, 1, nodes))
    )
    return total * np.linalg.norm(way, axis=-1)[..., None]


def marched_depth(reference, start, end, steps):
    """Return the depth of rays between two distances, (rays, 3 or 1)."""
    far = np.where(np.isfinite(end), end, _far(reference))
    u0, u1 = np.log1p(start), np.log1p(np.maximum(far, start))
    u = u0[:, None] + (u1 - u0)[:, None] * (np.arange(steps) + 0.5) / steps
    x, weight = np.expm1(u), np.exp(u) * ((u1 - u0) / steps)[:, None]
    point = reference.origin + x[..., None] * reference.direction[:, None]
    return np.sum(density(reference, point) * weight[..., None], axis=1)


def _far(reference):
    """Return a distance behind which nothing comes to the camera [m]."""
    if isinstance(reference.medium, HeightMedium):
        return 1e4
    return 40 / reference.medium.sigma_t.min() / max(reference.model.camera_scale, 1e-3)


def _of_light(reference, light, start, end, camera, steps, shadows):
    medium = reference.medium
    sun = isinstance(light, DirectionalLight)
    direction, origin = reference.direction, reference.origin
    far = np.where(np.isfinite(end), end, _far(reference))
    if sun:
        u0, u1 = np.log1p(start), np.log1p(far)
        u = u0[:, None] + (u1 - u0)[:, None] * (np.arange(steps) + 0.5) / steps
        x, dx = np.expm1(u), np.exp(u) * ((u1 - u0) / steps)[:, None]
    else:
        foot = direction @ (light.position - origin)
        h = np.linalg.norm(origin + foot[:, None] * direction - light.position, axis=1)
        v0, v1 = np.arcsinh((start - foot) / h), np.arcsinh((far - foot) / h)
        v = v0[:, None] + (v1 - v0)[:, None] * (np.arange(steps) + 0.5) / steps
        x = foot[:, None] + h[:, None] * np.sinh(v)
        dx = h[:, None] * np.cosh(v) * ((v1 - v0) / steps)[:, None]
    point = origin + x[..., None] * direction[:, None]
    total = np.zeros((len(direction), 3))
    for row in range(len(direction)):  # a ray at a time, for the memory
        total[row] = _of_ray(
            reference, light, point[row], x[row], dx[row], camera[row], shadows, sun
        )
    return total * np.broadcast_to(medium.albedo, 3) / (4 * np.pi)


def _of_ray(reference, light, point, x, dx, camera, shadows, sun):
    model, medium = reference.model, reference.medium
    direction = (point[1] - point[0]) / np.linalg.norm(point[1] - point[0])
    sigma_t = density(reference, point)
    if sun:
        way, weight = np.broadcast_to(-light.direction, point.shape), np.ones(len(x))
    else:
        away = light.position - point
        r = np.linalg.norm(away, axis=1)
        way = away / r[:, None]
        weight = law(model.law_of(surface=False), r) * window(model.range_of, r)
        if light.axis is not None:
            weight = weight * spot_edge(model, light, -(way @ light.axis))
    cosine = way @ direction
    phase = (
        np.full(len(x), 4 * np.pi) if model.phase == "none" and not sun else medium.phase(cosine)
    )
    if model.fade_of is not None:
        full, none = model.fade_of
        z = x * (direction @ reference.axis)
        weight = weight * np.maximum((none - z) / (none - full), 0)
    # Attenuation on both ways.
    depth = camera * depth_between(
        reference, reference.origin + 0 * point, point - reference.origin
    )
    near = reference.model.ends_of.near
    if near:
        first = reference.origin + direction * near / (
            direction @ reference.axis if model.ends_of.planes else 1.0
        )
        depth = depth - camera * depth_between(
            reference, reference.origin[None], (first - reference.origin)[None]
        )
    if model.light_scale:
        depth = depth + model.light_scale * (
            _sun_depth(reference, point, way) if sun else depth_between(reference, point, away)
        )
    depth = depth + model.light_length * sigma_t
    value = sigma_t * np.exp(-depth) * (phase * weight * dx)[:, None]
    if shadows and reference.occluders.shapes():
        value = (
            value * _visible(reference, point, way, np.full(len(x), np.inf) if sun else r)[:, None]
        )
    return value.sum(axis=0)


def _sun_depth(reference, point, way):
    # Up to the height where nothing is left: 60 scale heights over the point.
    medium = reference.medium
    rise = way[0] @ medium.up
    top = min(medium.cap, max(base + 60 * scale for _, base, scale in medium.layers))
    length = np.maximum(top - point @ medium.up, 0) / rise
    # In parts that grow, since the density falls as an exponential.
    edges = length[:, None] * (np.linspace(0, 1, 65) ** 3)
    total = 0
    for low, high in zip(edges.T[:-1], edges.T[1:]):
        total = total + depth_between(
            reference, point + low[:, None] * way, (high - low)[:, None] * way, 5
        )
    return total


def _visible(reference, point, way, r):
    # A hair off surfaces at both ends.
    hair = 1e-4
    ray = mi.Ray3f(mi.Point3f((point + hair * way).T), mi.Vector3f(way.T))
    ray.maxt = mi.Float(np.minimum(r - 2 * hair, 1e7))
    return ~np.array(reference.occluders.ray_test(ray))


def law(law, r):
    """Return f(r)."""
    if law.kind == "softened":
        return law.scale / (r**2 + law.length**2)
    if law.kind == "clamped":
        return np.maximum(r, law.length) ** -law.power
    if law.kind == "sphere":
        return 2 / (r**2 + law.length**2 + r * np.sqrt(r**2 + law.length**2))
    return r**-law.power


def window(window, r):
    """Return w(r)."""
    if window is None:
        return np.ones_like(r)
    s = np.minimum(r / window.end, 1)
    return {
        "quartic": (1 - s**4) ** 2,
        "fourth": 1 - s**4,
        "square": (1 - s**2) ** 2,
        "linear": 1 - s,
        "cut": (s < 1) * 1.0,
    }[window.kind]


def spot_edge(model, light, c):
    """Return the intensity of a spot over that on its axis, by the cosine of the angle to it."""
    kind, k = model.spot_of
    beam, cutoff = np.cos(light.beam), np.cos(light.cutoff)
    if kind == "rim":
        return 1 - np.clip((1 - c) / (1 - cutoff), 0, 1) ** k
    if kind == "angle":
        angle = np.arccos(np.clip(c, -1, 1))
        if light.cutoff == light.beam:
            return (angle < light.cutoff) * 1.0
        return np.clip((light.cutoff - angle) / (light.cutoff - light.beam), 0, 1)
    if light.cutoff == light.beam:
        return (c > cutoff) * 1.0
    t = np.clip((c - cutoff) / (beam - cutoff), 0, 1)
    return t**2 if kind == "cosine-squared" else t**2 * (3 - 2 * t)
