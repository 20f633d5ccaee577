# SPDX-License-Identifier: BSD-3-Clause
"""Closed forms of area lights and the oracle of light volumes are right themselves."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.panels import airlight_segments
from airlight.realtime.scene.read_scene import read_scene
from airlight.realtime.shadow_maps.projection import Projection
from airlight.realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.metrics.errors import error_metrics
from tests.evidence.closed_forms import polygon_in_disk, polygon_overlap
from tests.evidence.oracles.light_volume import oracle_airlight
from tests.helpers.scenes import spot, tiny_scene


def test_polygons_by_counting_points():
    triangle = np.array([[-0.3, -0.6], [1.4, 0.1], [0.1, 0.9]])
    rectangle = np.array([[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]])
    x, y = (np.arange(2000)[:, None] + 0.5) / 1000 - 1, (np.arange(2000) + 0.5) / 1000 - 1
    inside = np.ones((2000, 2000), bool)
    for start, end in zip(triangle, np.roll(triangle, -1, axis=0)):
        inside &= (end - start)[0] * (y - start[1]) > (end - start)[1] * (x - start[0])
    assert polygon_in_disk(triangle) == pytest.approx(
        np.mean(inside & (x**2 + y**2 < 1)) * 4, rel=1e-4
    )
    assert polygon_in_disk(triangle[::-1]) == pytest.approx(polygon_in_disk(triangle), rel=1e-14)
    assert polygon_overlap(triangle, rectangle) == pytest.approx(
        np.mean(inside & (np.abs(x) < 0.5) & (np.abs(y) < 0.4)) * 4, rel=1e-3
    )
    assert polygon_overlap(triangle + 5, rectangle) == 0


def maps_of(scene, size):
    read = read_scene(scene)
    return [cast_shadow_map(read.geometry, light, size) for light in read.lights]


def variations():
    """Return changes of the tiny scene by name."""
    coloured = {
        "sigma_t": {"type": "rgb", "value": [0.2, 0.4, 0.9]},
        "has_spectral_extinction": True,
    }
    return {
        "point": {},
        "soft spot": {"lamp": spot(beam=21.0)},
        "coloured extinction": {"fog": tiny_scene()["fog"] | coloured},
    }


def twin_error(description, size):
    """Return the error of the twin of a scene against the reference."""
    scene = mi.load_dict(description)
    return error_metrics(
        reference_image(scene).airlight,
        oracle_airlight(read_reference(scene), maps_of(scene, size)),
    )


@pytest.mark.parametrize("lamp", ["point", "soft spot"])
def test_nothing_hides_nothing(variant, lamp):
    """Rays are only cut at the edges of faces: what is left is the tolerance
    of the integrals, 1e-10.
    """
    assert twin_error(tiny_scene(ball=None, floor=None, **variations()[lamp]), 8).max < 1e-10


def plane_below(depth, size):
    """Return the shadow map of an unbounded horizontal plane below a point light, its
    horizon on borders of texels.

    Its height is -k_z / depth where a direction k points down, 0 elsewhere.
    """
    at = np.linspace(-1, 1, size + 1)
    v, u = np.meshgrid(at, at, indexing="ij")
    # Across and up are the two axes that follow a face's own: z is the second after
    # x and the first after y.
    down = np.stack([-v, -v, -u, -u, -1 + 0 * u, 1 + 0 * u])
    length = np.sqrt(1 + u**2 + v**2)
    distance = np.divide(length * depth, down, where=down > 0, out=np.full(down.shape, np.inf))
    return ShadowMap(size, distance.ravel(), Projection(None))


@pytest.mark.parametrize("level", [0.9, 1.5], ids=["below the camera", "above the camera"])
@pytest.mark.parametrize("surface", [np.inf, 3.7])
def test_shadow_of_a_plane_is_exact(variant, level, surface):
    """Rays that start at 1.3 m are lit where they are above the plane,
    up to the visible surface.
    """
    reference = read_reference(mi.load_dict(tiny_scene(size=(24, 18), ball=None, floor=None)))
    light, direction = reference.lights[0], reference.direction
    airlight = oracle_airlight(
        reference,
        [plane_below(light.position[2] - level, 8)],
        distance=np.full((reference.height, reference.width), surface),
    )
    reaches = (level - reference.origin[2]) / direction[:, 2]
    meets = (reaches > 0) & (reaches < surface)
    assert 0.1 < np.mean(meets) < 0.9
    crossing = np.where(meets, reaches, 0.0)
    if reference.origin[2] > level:
        x0, x1 = np.zeros(len(meets)), np.where(meets, crossing, surface)
    else:
        x0, x1 = crossing, np.where(meets, surface, 0.0)
    foot, height = foot_and_height(
        np.broadcast_to(reference.origin, direction.shape), direction, light.position
    )
    sigma_t = reference.medium.sigma_t[0]
    J, _ = airlight_segments(foot, height, x0, x1, sigma_t, reference.medium.phase)
    expected = J[:, None] * reference.medium.albedo * sigma_t * light.intensity / (4 * np.pi)
    # The angles of crossings are rounded, the integrals right to 1e-10.
    assert airlight.reshape(-1, 3) == pytest.approx(expected, rel=1e-9, abs=1e-10 * expected.max())


@pytest.mark.claim("error-by-size-of-the-map")
@pytest.mark.parametrize("what", ["point", "soft spot", "coloured extinction"])
def test_errors_fall_with_the_map_size(variant, what):
    """An edge is misplaced by a texel at most, so the error halves with it, give or take
    where edges fall in texels.
    """
    description = tiny_scene(size=(32, 24), **variations()[what])
    coarse, fine = (twin_error(description, size).relative_rmse for size in (16, 256))
    assert coarse < 0.05
    assert fine < coarse / 8
