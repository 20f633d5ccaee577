# SPDX-License-Identifier: BSD-3-Clause
"""Airlight between the corners of tiles, against the airlight of every pixel."""

from dataclasses import dataclass
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from airlight.realtime.frame.adaptive_sampling import adaptive_layers, tile_corners
from airlight.realtime.frame.renderer import frame_renderer, render_frame
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.methods.interface.method import tolerance as tolerance_parameter
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.camera import tiled_pixels
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene

SIZE = 48, 32


def image_of(function, tolerance, *, depth=None, lit=None):
    """Return the image of a function of column and row between corners, and how many pixels were computed."""
    width, height = SIZE
    pixel = mi.UInt32(tiled_pixels(width, height))
    corners = tile_corners(pixel, SimpleNamespace(width=width, height=height), by_rays=True)
    values, lights, distance = (
        np.ascontiguousarray(np.broadcast_to(entry, (height, width)).ravel(), dtype=kind)
        for entry, kind in (
            (function(*np.meshgrid(np.arange(width), np.arange(height))), np.float32),
            (True if lit is None else lit, np.uint32),
            (1.0 if depth is None else depth, np.float32),
        )
    )
    table, light = mi.Float(values), mi.UInt32(lights)
    computed = dr.zeros(mi.UInt32, width * height)

    def render(pixel, distance, last):
        value = dr.gather(mi.Float, table, pixel)
        dr.scatter(computed, mi.UInt32(1), pixel)
        return Layers(mi.Color3f(value, 2 * value, 0.5 * value), (dr.gather(mi.UInt32, light, pixel) != 0,))

    far = dr.gather(mi.Float, mi.Float(distance), pixel)
    layers = adaptive_layers(render, corners, pixel, far, width=width, tolerance=tolerance, last=None)
    color, (reached,) = layers.in_scattered, layers.visibility
    order, image = np.array(pixel), np.empty((width * height, 3))
    image[order] = np.array(color).T
    shown = np.empty(width * height, dtype=bool)
    shown[order] = np.array(reached)
    assert np.allclose(image[:, 1], 2 * image[:, 0], rtol=1e-6)
    return image[:, 0].reshape(height, width), shown.reshape(height, width), np.array(computed).reshape(height, width)


def test_a_linear_function_is_computed_at_corners_and_along_two_sides(variant):
    values, _, computed = image_of(lambda x, y: 3 + 0.2 * x + 0.1 * y, 1e-4)
    assert values == pytest.approx(3 + 0.2 * np.arange(48) + 0.1 * np.arange(32)[:, None], rel=1e-6)
    inner = np.zeros((32, 48), dtype=bool)
    inner[:28, :44] = True
    inner[::4, ::4] = False
    assert np.array_equal(computed == 0, inner)


@pytest.mark.claim("between-corners")
@settings(deadline=None, max_examples=90)
@given(
    seed=st.integers(0, 2**32 - 1),
    tolerance=st.sampled_from([1e-3, 5e-3, 0.03]),
    smooth=st.booleans(),
    kink=st.booleans(),
)
@example(seed=93215, tolerance=1e-3, smooth=True, kink=True)  # a kink in the last tile that the paraboloid hides
@example(seed=93215, tolerance=1e-3, smooth=False, kink=True)
def test_smooth_functions_and_kinks_err_by_the_tolerance_at_most(variant, seed, tolerance, smooth, kink):
    """A paraboloid, kinks along rows, columns and oblique lines, and their sum, where one may hide the other.

    The bound of the sum is that of the module: seven eighths of the paraboloid's own second differences are added.
    """
    random = np.random.default_rng(seed)
    bend, slope = random.normal(size=3) * 3e-4 * smooth, random.normal(size=2) * 0.01
    normal = np.array([(1, 0), (0, 1), (0.8, 0.6)])[random.integers(3)]
    place, jump = random.uniform(-5, 45), random.normal() * 0.05 * kink

    def function(x, y):
        paraboloid = bend[0] * (x - 20) ** 2 + bend[1] * (y - 15) ** 2 + bend[2] * (x - 20) * (y - 15)
        return (
            4 + paraboloid + slope[0] * x + slope[1] * y + jump * np.maximum(normal[0] * x + normal[1] * y - place, 0)
        )

    wanted = function(*np.meshgrid(np.arange(48), np.arange(32)))
    assume(wanted.min() >= 0.5)
    values, _, computed = image_of(function, tolerance)
    # Second differences of b x^2 between corners h = 4 apart are 2 b h^2.
    hidden = 7 / 8 * 32 * (np.abs(bend[:2]) @ np.abs(normal)) if kink else 0.0
    assert np.all(np.abs(values - wanted) <= (1.05 * tolerance + 1e-6) * wanted + hidden)
    assert np.all(values[computed > 0] == wanted.astype(np.float32)[computed > 0])


@pytest.mark.claim("between-corners")
def test_edges_of_surfaces_and_of_shadows_are_computed(variant):
    """Behind the same airlight: a step in depth, a thin pole between the corners, an edge of the light."""
    columns = np.arange(48)
    depth = np.where(columns < 21, 1.0, 3.0) * np.where(columns == 34, 0.5, 1.0)
    lit = np.broadcast_to(columns > 9, (32, 48))
    _, shown, computed = image_of(lambda x, y: 0 * x + 1, 0.1, depth=depth, lit=lit)
    assert np.array_equal(shown, lit)
    wanted = {*range(8, 12), *range(20, 24), *range(32, 36), *range(44, 48)}
    assert {*np.flatnonzero(computed[1] > 0).tolist()} == wanted


@pytest.mark.claim("between-corners")
@pytest.mark.parametrize(
    ("method", "parameters"),
    [("shadow-planes", {}), ("light-volumes", {"map": 64}), ("ray-march", {"steps": 24, "shadow": "ray"})],
)
def test_frames_err_by_about_the_tolerance(variant, method, parameters):
    whole, parted = (frame(method, parameters | {"tolerance": tolerance}) for tolerance in (0.0, 0.01))
    error = np.abs(parted.airlight - whole.airlight).max(axis=-1)
    assert np.max(error) / np.mean(whole.airlight) > 1e-7
    # Thin shadows fall between corners: this image is small.
    assert np.mean(error <= 0.01 * whole.airlight.max(axis=-1)) > 0.98
    assert np.mean(np.abs(parted.surface - whole.surface).max(axis=-1) > 1e-6) < 0.01
    assert np.array_equal(parted.distance, whole.distance)


def frame(method, parameters, size=(96, 72)):
    chosen = METHODS[method]
    turned = mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).rotate([1, 2, 3], 40).scale(0.33)
    scene = read_scene(mi.load_dict(tiny_scene(size=size, ball={"type": "cube", "to_world": turned})))
    kernel = KERNELS["exact"]
    return render_frame(frame_renderer(scene, chosen, kernel=kernel, **parameters))


@dataclass(frozen=True)
class Layered(Method):
    """Layers that are smooth over the image, and a mask that is not."""

    name = "layered"
    uses_kernel = False
    provides_visibility = True
    by_rays = True

    tolerance: float = tolerance_parameter()

    def render(self, view, state, kernel):
        across, up = view.direction.x, view.direction.z
        Color = type(view.medium.albedo)
        return Layers(
            Color(2 + across, 3 + up, 4 - up),
            (0.6 + 0.2 * across, up > 0.1),
            Color(0.5 + 0.1 * up),
            Color(1 + 0.3 * across),
        )


def test_every_layer_is_interpolated(variant):
    two = tiny_scene(size=(48, 36)) | {"second": tiny_scene()["lamp"] | {"position": [-1.1, -0.9, 2.3]}}
    scene = read_scene(mi.load_dict(two))
    whole, parted = (render_frame(frame_renderer(scene, Layered, tolerance=tolerance)) for tolerance in (0.0, 0.02))
    for layer in ("airlight", "surface"):
        interpolated, wanted = getattr(parted, layer), getattr(whole, layer)
        np.testing.assert_allclose(interpolated, wanted, rtol=0.02)
        assert np.max(np.abs(interpolated - wanted)) > 0
