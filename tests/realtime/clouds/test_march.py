# SPDX-License-Identifier: BSD-3-Clause
"""Claim: depths and light of clouds with densities are right, and those of a homogeneous
cloud where the grid is even.

A transport by a formula stands for the tables of `cloud-collectors`.
"""

from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.methods.cloud_collectors as method
from airlight.realtime.clouds.collector_search import Search
from airlight.realtime.clouds.density_maps import dense_surface, light_depths, sun_depths
from airlight.realtime.clouds.march import cloud_surfaces, depths_along, segment_through
from airlight.realtime.numerics.array_types import aligned_array
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import box, placed
from tests.helpers.clouds import (
    SUN,
    TURN,
    cloud,
    cloud_scene,
    crossings,
    dense,
    linear_between,
    ring,
)
from tests.helpers.frames import render
from tests.helpers.transport_formula import slabs_as_they_are

pytestmark = pytest.mark.usefixtures("variant")

LOW, HIGH = np.array([-131.7, -117.3, -141.9]), np.array([139.1, 121.7, 143.3])
#: Waves that a coarse grid holds, with zeros: rho may be 0 at the hull.
WAVES = 0.021, 0.029, 0.037
SKY = {"type": "constant", "radiance": {"type": "rgb", "value": [0.07, 0.11, 0.19]}}


@pytest.fixture(autouse=True)
def transport(monkeypatch):
    def formula(number, t, d, mu, cos_phi, sin_phi, mu_l):
        return (
            (2 + mu) * mu_l * t / (1 + t) * dr.exp(-0.1 * d) / (3 + type(t)(number)),
            -0.2 * mu,
            0.1 * mu,
            0.5 + 0 * t,
        )

    monkeypatch.setattr(method, "canonical_transport", lambda phase, albedo: None)
    monkeypatch.setattr(method, "on_device", lambda grid, types: formula)


def waves(voxels):
    """Return a smooth density on a grid of about so many voxels along each axis."""
    counts = (voxels, voxels + 3, voxels - 2)
    along = [
        low + (high - low) * (np.arange(n) + 0.5) / n for low, high, n in zip(LOW, HIGH, counts)
    ]
    z, y, x = np.meshgrid(along[2], along[1], along[0], indexing="ij")
    product = np.cos(WAVES[0] * x + 0.3) * np.cos(WAVES[1] * y - 0.9) * np.cos(WAVES[2] * z + 0.2)
    return np.clip(0.8 * product + 0.45, 0, 1)


def uneven(values=None, **parts):
    values = waves(13) if values is None else values
    return mi.load_dict(
        cloud_scene(sun=SUN, ring=cloud("ring", ring(), dense(values, LOW, HIGH)), **parts)
    )


def even_and_homogeneous(**parts):
    """Return scenes of a box, in which light maps that know both ends of a
    cloud alone know all of it.
    """
    mesh = placed(box((111.0, 97.0, 83.0)), (3.7, -2.1, 1.9), TURN)
    even = cloud("box", mesh, dense(np.ones((2, 3, 4)), LOW, HIGH))
    return [
        mi.load_dict(cloud_scene(sun=SUN, box=shape, **parts))
        for shape in (even, cloud("box", mesh))
    ]


def rendered(scene, name, precision="single", **parameters):
    return render(scene, name, precision=precision, extra_layers=True, **parameters)


def rays_of(scene, precision="single"):
    read = read_scene(scene, precision)
    pixel = dr.arange(mi.UInt32, 16 * 12)
    return read, ray_directions(read.camera, pixel)[0]


def exact_depths(values, read, direction, sigma_t=0.0363):
    """Return the depths of rays by small steps through all triangles in float64."""
    origin, mesh = np.array(read.camera.origin, dtype=float).ravel(), ring()
    depths = []
    for way in np.array(direction, dtype=float).T:
        distance, leaves = crossings(mesh, origin, way)
        depth, before = 0.0, 0.0
        for end, leaving in zip(distance, leaves):
            if leaving:
                places = before + (end - before) * (np.arange(4000) + 0.5) / 4000
                rho = (
                    linear_between(values, LOW, HIGH, origin + places[:, None] * way) / values.max()
                )
                depth += sigma_t * rho.mean() * (end - before)
            before = end
        depths.append(depth)
    return np.array(depths)


@pytest.mark.claim(
    "hypertexture-depths", tolerance="2 % of the mean with a step a voxel; falls with its square"
)
def test_depths_are_the_sums_of_the_grid_and_converge():
    values = waves(13)
    read, direction = rays_of(uneven(values))
    surfaces, clouds = cloud_surfaces(read), read.medium.clouds
    expected = exact_depths(values / 1.0, read, direction, 0.0363 * values.max())
    errors = []
    for stride in (2.0, 1.0, 0.5, 0.25):
        (found,) = depths_along(
            surfaces,
            clouds,
            read.camera.origin,
            direction,
            mi.Float(dr.inf),
            stride=dr.opaque(mi.Float, stride),
            seen=False,
        )
        errors.append(np.sqrt(np.mean((np.array(found) - expected) ** 2)) / expected.mean())
    assert errors[1] < 0.02
    assert errors[3] < 0.3 * errors[1]
    (seen,) = depths_along(
        surfaces,
        clouds,
        read.camera.origin,
        direction,
        mi.Float(dr.inf),
        stride=dr.opaque(mi.Float, 0.25),
        seen=True,
    )
    np.testing.assert_allclose(np.exp(-np.array(seen)), np.exp(-expected), atol=2e-3)


@pytest.mark.claim(
    "hypertexture-even", tolerance="1e-5 of opacity, 1 % of light: the map of depths has 256 texels"
)
@pytest.mark.parametrize("name", ["cloud-octaves", "cloud-collectors"])
@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
def test_an_even_grid_is_a_homogeneous_cloud(name, precision, monkeypatch):
    even, homogeneous = even_and_homogeneous(sky=SKY)
    # A uniform sky needs a slab, which no grid has: it is a beam there.
    # Collectors in grids count whole.
    monkeypatch.setattr(method, "Search", lambda *args, covered: Search(*args, covered=False))
    grid, plain = (rendered(scene, name, precision, sky="beams") for scene in (even, homogeneous))
    np.testing.assert_allclose(grid.extra["opacity"], plain.extra["opacity"], atol=1e-5)
    np.testing.assert_allclose(grid.surface, plain.surface, atol=1e-5)
    assert set(grid.extra) == set(plain.extra)
    for layer, light in plain.extra.items():
        mean, other = np.mean(light), np.array(grid.extra[layer])
        assert np.mean(other) == pytest.approx(mean, rel=0.01), layer
        assert np.sqrt(np.mean((other - light) ** 2)) < 0.05 * mean, layer


@pytest.mark.claim("hypertexture-converges", tolerance="none: errors that shrink at least by half")
@pytest.mark.parametrize(
    "name", ["cloud-octaves", pytest.param("cloud-collectors", marks=pytest.mark.slow)]
)
def test_finer_grids_of_a_smooth_field_converge(name, monkeypatch):
    slabs_as_they_are(monkeypatch)
    images = [np.array(rendered(uneven(waves(n)), name).airlight) for n in (12, 24, 48, 96)]
    steps = [np.sqrt(np.mean((a - b) ** 2)) / images[-1].mean() for a, b in pairwise(images)]
    assert steps[1] < 0.6 * steps[0]
    assert steps[2] < 0.6 * steps[1]
    assert steps[2] < 0.02


@pytest.mark.claim(
    "hypertexture-segments",
    tolerance="0.05 of depth in the mean, of segments of 2.5: 256 texels, 64 layers",
)
def test_the_map_of_a_sun_holds_the_depths_of_segments():
    """In and between the limbs of the ring, where the map must know the gap."""
    read = read_scene(uneven())
    surfaces, clouds, light = cloud_surfaces(read), read.medium.clouds, read.lights[0]
    random = np.random.default_rng(3)
    points = mi.Vector3f(
        *(aligned_array(mi.Float, column) for column in random.uniform(LOW, HIGH, (4000, 3)).T)
    )
    stride = dr.opaque(mi.Float, 0.25)
    (expected,) = (
        np.array(segment)
        for segment in segment_through(surfaces, clouds, light, stride=stride)(points, True)
    )
    found = (
        0.0363
        * waves(13).max()
        * np.array(light_depths(surfaces, clouds, light, cloud=0, stride=stride).at(points))
    )
    assert expected.max() > 2
    deep = expected > 0.1
    assert np.abs(found - expected)[deep].mean() < 0.05
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_maps_of_further_clouds_compile_nothing():
    """The number of a cloud is data, and no part of the code of a kernel."""
    shapes = {
        f"cloud-{x:g}": cloud(
            f"cloud-{x:g}",
            placed(box((40.0, 50.0, 30.0)), (x, 0.0, 0.0), TURN),
            dense(waves(5), LOW, HIGH),
        )
        for x in (-80.0, 0.0, 80.0)
    }
    read = read_scene(mi.load_dict(cloud_scene(sun=SUN, **shapes)))
    surfaces, stride = cloud_surfaces(read), dr.opaque(mi.Float, 1.0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        sun_depths(surfaces, read.medium.clouds, read.lights, stride=stride)
        hashes = [kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])]
    assert set(hashes[-4:]) <= set(hashes[:-4])


def test_the_surface_is_where_the_density_passes_the_threshold():
    values = waves(13)
    read, direction = rays_of(uneven(values), "double")
    surfaces, clouds = cloud_surfaces(read), read.medium.clouds
    met = dense_surface(
        surfaces,
        clouds,
        read.camera.origin,
        direction,
        mi.Float64(dr.inf),
        threshold=0.5,
        stride=mi.Float64(0.1),
    )
    there = np.isfinite(np.array(met.distance))
    points = np.array(
        read.camera.origin + direction * dr.select(dr.isfinite(met.distance), met.distance, 0)
    ).T
    rho = linear_between(values / values.max(), LOW, HIGH, points)
    # Where the hull cuts a denser place it is the surface.
    assert (np.abs(rho[there] - 0.5) < 5e-3).sum() > 5
    assert np.all(rho[there] > 0.495)
    assert (~there).any()
