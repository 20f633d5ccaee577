# SPDX-License-Identifier: BSD-3-Clause
"""As few panels as a segment in a medium needs: against many more, smaller ones."""

import drjit as dr
import numpy as np
import pytest

from realtime.numerics.aligned import aligned_array
from tests.helpers.kernel_values import opaque, phase_of
from tests.realtime.bounded_media.test_facet_walk import lines_in, seen_medium


def segments(name, light, phase, *, sigma_t, precision="double"):
    """Return chords of a medium, a part of each for every other one, with all that their integrals need."""
    from realtime.bounded_media.panels import MediumSegment
    from realtime.rays.ray_light import ray_geometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium

    seen, types = seen_medium(name, light, precision)
    start, direction, low, high = lines_in(name, light)
    part = np.where(np.arange(len(low)) % 2, 0.37, 1.0) * (high - low)
    kind, g = phase
    medium = opaque(Medium((types.scalar(sigma_t),), types.color(1.0), phase_of(kind, g, types.scalar)))
    lamp = opaque(Light(types.vector(*(float(c) for c in light)), types.color(1.0)))
    v0, d = (types.vector(*(aligned_array(types.scalar, c) for c in v.T)) for v in (start, direction))
    from realtime.bounded_media.facet_walk import entry_planes

    x0 = aligned_array(types.scalar, low)
    segment = MediumSegment(
        medium=medium,
        around=None,
        light=lamp,
        geometry=ray_geometry(lamp.position + v0, d, lamp),
        start=v0,
        direction=d,
        begin=x0,
        before=(dr.opaque(types.scalar, 0.0),),
        seen=seen,
        planes=entry_planes(seen),
    )
    return segment, x0, aligned_array(types.scalar, low + part)


def integral(segment, x0, x1):
    from realtime.bounded_media.panels import medium_integral

    return np.array(medium_integral(segment, x0, x1).x, dtype=np.float64)


@pytest.mark.parametrize("name", ["gem", "column"])
def test_panels_against_a_sum_over_small_steps(variant, name):
    """What the leg leaves before the medium by the least of all planes; midpoints of 8000 steps."""
    from tests.realtime.bounded_media.test_facet_walk import least_of_all

    light, sigma_t = np.array([1.7, 0.4, 2.9]), 1.3
    for precision, close in (("double", 1e-6), ("single", 2e-5)):
        segment, x0, x1 = segments(name, light, ("hg", 0.6), sigma_t=sigma_t, precision=precision)
        panels = integral(segment, x0, x1)
        start, direction, low, _ = lines_in(name, light)
        begin, end = np.array(x0, dtype=np.float64), np.array(x1, dtype=np.float64)
        for ray in range(0, len(low), 41):
            steps = begin[ray] + (np.arange(8000) + 0.5) / 8000 * (end[ray] - begin[ray])
            v = start[ray] + steps[:, None] * direction[ray]
            r = np.linalg.norm(v, axis=1)
            enter, _ = least_of_all(name, light, v)
            depth = sigma_t * (steps - low[ray] + r - r / np.maximum(enter, 1))
            cosine = -(v @ direction[ray]) / r
            phase = (1 - 0.36) / (1.36 - 1.2 * cosine) ** 1.5
            expected = sigma_t * np.mean(phase * np.exp(-depth) / r**2) * (end[ray] - begin[ray])
            assert panels[ray] == pytest.approx(expected, rel=close)
