# SPDX-License-Identifier: BSD-3-Clause
"""Height fog on the device: the certified rays in both precisions, frames against the
reference, and refusals.
"""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.height_fog import HeightFog as HostFog
from airlight.analytic.height_fog import HeightRays as HostRays
from airlight.analytic.height_fog import Layer as HostLayer
from airlight.analytic.height_fog import height_fog_segments
from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.rays import ray_geometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.height_fog import HeightFog, Layer, phi
from airlight.realtime.scene.media.medium import LitRays
from airlight.realtime.scene.phase import HenyeyGreenstein, Isotropic
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import find_kernel
from tests.helpers.frames import relative_rmse
from tests.helpers.height_fog import LAMP, SPOT, SUN, Row, fog_xml, rows


def ends_of(row):
    """Return a floor and a cap beyond which a row finds nothing: scenes have them,
    and no infinite density.
    """
    heights = [row.origin[2]]
    heights += [] if row.sun else [row.origin[2] + row.direction[2] * row.x1, row.light[2]]
    layers = [layer for layer in row.fog.layers if layer.sigma_t > 0]
    floor = max(layer.base - 60 * layer.scale_height for layer in layers)
    cap = max(layer.base + 60 * layer.scale_height for layer in layers)
    return min(floor, *heights) - 1, max(cap, *heights) + 1


def relative_errors(chosen, precision, kernel=KERNELS["exact"]):
    """The relative errors of rows of one kind, in one call of the medium."""
    types = array_types(precision)

    def number(values):
        return types.scalar(np.array(values, dtype=np.float64))

    def vector(values):
        return types.vector(*(number(column) for column in np.array(values).T))

    def layer(i):
        found = [row.fog.layers[i] for row in chosen]
        return Layer(
            *(number([getattr(each, name) for each in found]) for name in Layer.__annotations__)
        )

    medium = HeightFog(
        (layer(0), layer(1)),
        number([row.fog.constant for row in chosen]),
        chosen[0].fog.clamped,
        number([ends_of(row)[0] for row in chosen]),
        number([ends_of(row)[1] for row in chosen]),
        types.vector(0, 0, 1),
        types.color(1),
        HenyeyGreenstein(number([row.phase.g for row in chosen])),
    )
    directions, places = (
        np.array([getattr(row, name) for row in chosen]).T for name in ("direction", "light")
    )
    light = Light(position=vector(places.T), intensity=types.color(1))
    if chosen[0].sun:  # a light at infinity is one that has an extent
        light = replace(
            light,
            exact_axis=mi.Vector3d(*(mi.Float64(-column) for column in places)),
            extent=types.scalar(1),
        )
    aim = mi.Vector3d(*(mi.Float64(column) for column in directions))
    rays = medium.rays(vector([row.origin for row in chosen]), vector(directions.T), aim)
    geometry = ray_geometry(rays.origin, rays.aim, light)
    lit = medium.lit(rays, light, geometry, kernel)
    found = lit.airlight(number([row.x0 for row in chosen]), number([row.x1 for row in chosen]))
    expected = np.array([row.value for row in chosen])
    return np.abs(np.array(found.x, dtype=np.float64) / expected - 1)


def by_tag(*tags, clamped=False):
    return [
        row
        for row in rows()
        if row.tag in tags and row.fog.clamped == clamped and 1e-30 < row.value < 1e30
    ]


SUNS = ("sun", "sun-infinite", "sun-resonant")
GENERIC = ("generic", "large-H", "horizontal", "grazing", "above", "below")
HARD = ("small-H", "near-light", "strong-g")
_STEEP = ((1.5, 0.4), (0.3, 2.0), (0.02, 15.0))  # extinction [1/m] and scale height [m]


@pytest.mark.claim(
    "height-fog-kernels", tolerance="1e-5 in float32 to an exponent of 30, 1e-12 in float64"
)
def test_suns_on_certified_rays(variant):
    assert relative_errors(by_tag(*SUNS), "double").max() < 1e-12
    # An exponent of 30 has as many roundings in float32.
    chosen = [row for row in by_tag(*SUNS) if row.value > 1e-13]
    assert relative_errors(chosen, "single").max() < 1e-5


@pytest.mark.claim(
    "height-fog-kernels",
    tolerance="1e-5 in float32, 1e-9 in float64; of hard rays the coordinates'",
)
@pytest.mark.parametrize("clamped", [False, True])
def test_panels_on_certified_rays(variant, clamped):
    generic = by_tag("clamped", clamped=True) if clamped else by_tag(*GENERIC)
    assert relative_errors(generic, "single").max() < 2e-5
    assert relative_errors(generic, "double").max() < 1e-9
    if not clamped:
        assert relative_errors(by_tag(*HARD), "double").max() < 1e-8
        # Next to a light the rounding of the row's coordinates is a part of the distance.
        assert relative_errors(by_tag("small-H"), "single").max() < 2e-5


@pytest.mark.claim(
    "height-fog-kernels", tolerance="1e-4 in float32: depths of 30 have a rounding of 1e-5 or two"
)
@pytest.mark.parametrize("clamped", [False, True])
def test_no_panel_misses_a_layer(variant, clamped):
    """Thin layers, long rays and lights far above: a panel that is too long for any of
    them is wrong by a tenth.
    """
    random, count = np.random.default_rng(5), 3000
    fogs = [
        HostFog((HostLayer(s, 0.0, h), HostLayer(0.05, 1.0, 40.0)), 0.0, clamped) for s, h in _STEEP
    ]
    origin, direction, place = (
        random.normal(size=(3, count, 3)).astype(np.float32).astype(np.float64)
    )
    origin, place = 5 * origin, place * np.exp(random.uniform(-2, 3, (count, 1))).astype(np.float32)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    x0 = np.where(random.random(count) < 0.5, 0, random.uniform(0, 10, count)).astype(np.float32)
    x1 = x0 + np.exp(random.uniform(-3, 4, count)).astype(np.float32)
    foot, height = foot_and_height(origin, direction, place)
    lines = HostRays(origin[:, 2], direction[:, 2], foot, height, place[:, 2])
    for fog in fogs:
        values = height_fog_segments(fog, lines, x0, x1, phase_from_words("hg:0.35"), rtol=1e-8)[0]
        chosen = [
            Row("drawn", False, fog, phase_from_words("hg:0.35"), *row)
            for row in zip(origin, direction, place, x0, x1, values)
            if row[-1] > 1e-12 * np.quantile(values, 0.9)
        ]
        assert len(chosen) > count / 3
        assert relative_errors(chosen, "single").max() < 1e-4


@pytest.mark.claim(
    "height-fog-kernels", tolerance="1e-4 for nine of ten generic rays, as asked for"
)
def test_sixteen_nodes_in_w(variant):
    errors = relative_errors(by_tag(*GENERIC), "single", KERNELS["quadrature"])
    assert np.quantile(errors, 0.9) < 1e-5
    assert (
        np.quantile(relative_errors(by_tag(*GENERIC), "double", find_kernel("quadrature-8")), 0.9)
        < 1e-5
    )


def test_a_segment_whose_panels_run_out_is_not_dark(variant, monkeypatch):
    """A frame refuses what is not finite; a sum of some of the panels was
    a dark pixel in silence.
    """
    monkeypatch.setattr(LitRays, "most_panels", 1)
    errors = relative_errors(by_tag(*GENERIC), "double")
    finite = np.isfinite(errors)
    assert not finite.all()
    assert errors[finite].max() < 1e-9


def test_phi_keeps_its_digits(variant):
    for precision, error in (("single", 3e-7), ("double", 3e-15)):
        Float = array_types(precision).scalar
        u = (
            np.concatenate([[0.0], np.geomspace(1e-12, 60, 400)])
            .astype(np.float32)
            .astype(np.float64)
        )
        expected = np.where(u == 0, 1, -np.expm1(-u) / np.where(u == 0, 1, u))
        np.testing.assert_allclose(np.array(phi(Float(u)), dtype=np.float64), expected, rtol=error)


@pytest.fixture
def scene(variant, tmp_path):
    def load(*lights):
        path = tmp_path / "fog.xml"
        path.write_text(fog_xml(*lights, size=(32, 24), ball="cube"))
        return load_scene(str(path)).scene

    return load


def frame(scene, method, kernel="exact", **parameters):
    return render_frame(
        frame_renderer(read_scene(scene), METHODS[method], kernel=find_kernel(kernel), **parameters)
    )


@pytest.mark.parametrize("clamped", [False, True])
def test_rays_end_where_nothing_is_left(variant, clamped):
    """Below and above the base, up, level and down: an end that is given has the depth."""
    types, depth = array_types("double"), 20.0
    start, rise = (
        types.scalar(grid.ravel())
        for grid in np.meshgrid([-40.0, -1.0, 0.5, 9.0], [-0.9, -0.1, 0.0, 0.02, 0.3, 1.0])
    )
    up, number = types.vector(0, 0, 1), types.scalar
    layers = tuple(Layer(*map(number, each)) for each in ((0.05, 0.0, 5.0), (0.002, 3.0, 900.0)))
    medium = HeightFog(
        layers, number(0), clamped, number(-1e6), number(1e6), up, types.color(1), Isotropic()
    )
    rays = medium.rays(up * start, types.vector(dr.sqrt(1 - rise * rise), 0, rise))
    length = medium.length_from(rays, number(0), depth)
    (found,) = medium.optical_depth(rays, number(0), dr.minimum(length, 1e6))
    assert np.all((np.array(found) > depth * (1 - 1e-3)) | np.isinf(np.array(length)))
    assert np.isfinite(np.array(length)).any()


@pytest.mark.claim("height-fog-methods", tolerance="1e-5 relative RMSE of shadow planes in float32")
@pytest.mark.parametrize("lights", [(LAMP, SPOT), (SUN,)], ids=["local", "sun"])
def test_frames_are_the_reference(scene, lights):
    loaded = scene(*lights)
    reference = quadrature_image(read_reference(loaded), checks=0)
    planes = frame(loaded, "shadow-planes")
    assert relative_rmse(planes.airlight, reference.airlight) < 1e-5
    assert relative_rmse(planes.surface, reference.surface) < 1e-4
    # Maps and steps: some percent at their defaults.
    for method, error in (("light-volumes", 0.02), ("min-max", 0.05), ("ray-march", 0.1)):
        assert relative_rmse(frame(loaded, method).airlight, reference.airlight) < error, method
    even = frame(loaded, "ray-march", spacing="uniform", steps=1000)
    assert relative_rmse(even.airlight, reference.airlight) < 0.1


@pytest.mark.claim("height-fog-methods", tolerance="a running sum errs by the square of its step")
def test_a_running_sum_of_the_depth(scene):
    loaded = scene(LAMP)
    how = {"spacing": "uniform", "shadow": "none"}

    def differs(steps):
        exact_depth, running = (
            frame(loaded, "ray-march", steps=steps, depth=depth, **how).airlight
            for depth in ("exact", "running")
        )
        return relative_rmse(running, exact_depth)

    few, many = differs(25), differs(100)
    assert 1e-4 < few < 0.3
    assert few > 8 * many


@pytest.mark.claim("height-fog-methods", tolerance="1e-5 relative RMSE of shadow planes in float32")
@pytest.mark.parametrize("name", ["street", "meadow", "valley"])
def test_built_in_scenes(variant, name):
    loaded = load_scene(name, (24, 18)).scene
    reference = quadrature_image(read_reference(loaded))
    assert reference.airlight_error.max() < 1e-6 * reference.airlight.mean()
    assert relative_rmse(frame(loaded, "shadow-planes").airlight, reference.airlight) < 1e-5


@pytest.mark.parametrize("name", [*sorted(set(KERNELS) - {"exact", "quadrature"}), "math:fsum"])
def test_no_image_has_the_name_of_a_kernel_that_height_fog_did_not_ask(variant, name):
    kernel = find_kernel(name).prepared(array_types("single").scalar)
    with pytest.raises(InputError, match=f"kernel: got {name}, which is of homogeneous fog"):
        relative_errors(by_tag("generic")[:2], "single", kernel)


@pytest.mark.claim("height-fog-refused", tolerance="by name")
def test_refusals(scene):
    with pytest.raises(InputError, match="kernel: got taylor, which is of homogeneous fog"):
        frame(scene(LAMP), "shadow-planes", "taylor")
    with pytest.raises(
        InputError, match="light 'sun' is directional and shines from the horizon or below"
    ):
        read_scene(scene(SUN.replace('z="-0.45"', 'z="0.1"')))
