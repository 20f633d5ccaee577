# SPDX-License-Identifier: BSD-3-Clause
"""The reference in density grids: against quadrature by look-ups alone, homogeneous fog,
Mitsuba; injected faults.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, simpson

from airlight.errors import InputError
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.fields import field_of
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.validation.scenes.loading import load_scene
from tests.evidence.injected import Wrap, injected
from tests.helpers.biases import biases
from tests.helpers.clouds import linear_between
from tests.helpers.density_grid import (
    ALBEDO,
    HIGH,
    INSIDE,
    LOW,
    ROUGH,
    SCALE,
    SHAPES,
    SPOT,
    grid_xml,
    volume,
)
from tests.helpers.height_fog import LAMP, SUN

BATCHES = 40


@pytest.fixture
def reference(variant, tmp_path):
    def read(*lights, values=ROUGH, albedo=ALBEDO, shapes=SHAPES, **how):
        path = tmp_path / "grid.xml"
        path.write_text(
            grid_xml(
                volume(tmp_path / "smoke.vol", values, **how), *lights, albedo=albedo, shapes=shapes
            )
        )
        return read_reference(load_scene(str(path)).scene)

    return read


def extinction(points, medium):
    """Return the extinction of the rough grid at points [1/m], 0 beside its
    box, as Mitsuba rounds that.
    """
    inside = np.all((points >= medium.low) & (points <= medium.high), axis=-1)
    flat = linear_between(ROUGH.astype(np.float64), medium.low, medium.high, points.reshape(-1, 3))
    flat = flat.reshape(points.shape[:-1])
    return np.where(inside, float(np.float32(SCALE)) * flat, 0.0)


def box_ends(start, way, medium):
    """Return where lines enter and leave the box, in lengths of their ways."""
    with np.errstate(divide="ignore"):
        ends = np.stack([(corner - start) / way for corner in (medium.low, medium.high)])
    return np.maximum(ends.min(axis=0).max(axis=-1), 0.0), ends.max(axis=0).min(axis=-1)


@pytest.mark.claim(
    "density-grid-reference", tolerance="1e-9 relative: scipy's quad, cut at nothing"
)
def test_optical_depths_are_those_of_scipy(reference):
    random = np.random.default_rng(5)
    origin, end = random.uniform(LOW - 1, HIGH + 1, (2, 4, 3))
    end[0], origin[1, 2] = origin[0] + [0, 0, 5], end[1, 2]  # along an axis, and in a plane
    length = np.linalg.norm(end - origin, axis=1)
    way = (end - origin) / length[:, None]
    scene = reference(LAMP)
    found = field_of(scene).optical_depth(origin, way, np.zeros(4), length)
    for start, direction, far, depth in zip(origin, way, length, found, strict=True):

        def along(x, start=start, direction=direction):
            return extinction((start + x * direction)[None], scene.medium)[0]

        near, leaves = box_ends(start, direction, scene.medium)
        steps = np.linspace(near, min(far, leaves), 41)
        parts = [quad(along, *ends, epsabs=1e-10)[0] for ends in pairwise(steps)]
        np.testing.assert_allclose(depth, sum(parts), rtol=1e-9)


@pytest.mark.claim(
    "density-grid-reference", tolerance="3e-5 relative: 1000 steps with kinks, and 600 to the light"
)
@pytest.mark.parametrize("light", [LAMP, SUN])
def test_airlight_by_look_ups_alone(reference, light):
    scene = reference(light, shapes="")
    image = quadrature_image(scene, checks=0)
    assert image.airlight_kind == "estimated"  # by two rules, which kinks deceive
    radiance, bound = (part.reshape(-1, 3) for part in (image.airlight, image.airlight_error))
    for row in (86, 106, 121):
        assert radiance[row, 0] > 0
        way = scene.direction[row]
        x = np.linspace(*box_ends(scene.origin, way, scene.medium), 1001)
        points = scene.origin + x[:, None] * way
        sigma_t = extinction(points, scene.medium)
        if scene.lights:
            to_light = scene.lights[0].position - points
            r = np.linalg.norm(to_light, axis=1)
            strength = scene.lights[0].intensity[None] / r[:, None] ** 2
        else:
            r = np.full(len(x), 9.0)
            to_light = np.broadcast_to(-9.0 * scene.directional[0].direction, points.shape)
            strength = scene.directional[0].irradiance[None]
        ends = np.minimum(box_ends(points, to_light, scene.medium)[1], 1.0)
        along = np.linspace(0, ends, 601, axis=1)
        path = points[:, None] + along[:, :, None] * to_light[:, None]
        depth = np.trapezoid(extinction(path, scene.medium), along, axis=1) * r
        depth += np.concatenate([[0], np.cumsum(0.5 * (sigma_t[1:] + sigma_t[:-1]) * np.diff(x))])
        phase = scene.medium.phase((to_light @ way) / r)
        f = (
            (sigma_t * np.exp(-depth) * phase)[:, None]
            * strength
            * scene.medium.albedo
            / (4 * np.pi)
        )
        np.testing.assert_allclose(radiance[row], simpson(f, x=x, axis=0), rtol=3e-5)
    assert bound.max() < 1e-4 * radiance.mean()


@pytest.mark.claim(
    "density-grid-reference", tolerance="1e-5 relative: twice what panels of the grid may differ by"
)
def test_a_constant_grid_is_homogeneous_fog(reference, tmp_path):
    lights = LAMP, SPOT, SUN
    even = quadrature_image(
        reference(*lights, values=np.full((4, 3, 5), 0.25, np.float32)), checks=0
    )
    text = grid_xml('<float name="sigma_t" value="0.25"/>', *lights).replace(
        '<ref id="smoke" name="medium"/>', ""
    )
    size, corner = (", ".join(map(str, each)) for each in (0.5 * (HIGH - LOW), 0.5 * (HIGH + LOW)))
    cube = f"""<shape type="cube" id="box"><bsdf type="null"/><ref id="smoke" name="interior"/>
        <transform name="to_world"><scale value="{size}"/><translate value="{corner}"/></transform></shape></scene>"""
    path = tmp_path / "even.xml"
    path.write_text(text.replace("</scene>", cube))
    expected = quadrature_image(read_reference(load_scene(str(path)).scene), checks=0)
    for layer in ("airlight", "surface"):
        found, known = (getattr(image, layer) for image in (even, expected))
        np.testing.assert_allclose(found, known, rtol=1e-5, atol=1e-6 * known.mean())


@pytest.mark.claim("density-grid-reference", tolerance="none: the same numbers")
@pytest.mark.parametrize("size", [1.0, 1.3])
def test_a_shape_that_holds_the_box_bounds_nothing(reference, tmp_path, size):
    plain = reference(LAMP, SUN)
    half, corner = (
        ", ".join(map(str, each)) for each in (0.5 * size * (HIGH - LOW), 0.5 * (HIGH + LOW))
    )
    cube = f"""<shape type="cube" id="box"><bsdf type="null"/><ref name="interior" id="smoke"/>
        <transform name="to_world"><scale value="{half}"/><translate value="{corner}"/></transform></shape></scene>"""
    path = tmp_path / "grid.xml"
    text = path.read_text().replace('<ref id="smoke" name="medium"/>', "")
    path.write_text(text.replace("</scene>", cube))
    held = read_reference(load_scene(str(path)).scene)
    np.testing.assert_array_equal(held.medium.values, plain.medium.values)
    np.testing.assert_array_equal(held.medium.low, plain.medium.low)
    assert not held.media
    assert len(held.occluders.shapes()) == len(plain.occluders.shapes())
    small = cube.replace(half, ", ".join(map(str, 0.4 * (HIGH - LOW))))
    path.write_text(text.replace("</scene>", small))
    with pytest.raises(InputError, match="a convex shape that holds its whole box"):
        read_reference(load_scene(str(path)).scene)


SPIKE = np.zeros((24, 25, 26), np.float32)
SPIKE[2, 3, 4] = 1.0


@pytest.mark.claim("density-grid-reference", tolerance="none: the same voxel")
def test_a_grid_that_is_empty_but_for_a_voxel_lies_as_mitsuba_puts_it(reference):
    scene = reference(LAMP, values=SPIKE, turn='<scale x="-1"/>')
    assert np.argwhere(scene.medium.values > 0).tolist() == [[2, 3, 21]]


@pytest.mark.claim("density-grid-reference", tolerance="1e-12 relative: rounding")
def test_a_linear_function_of_height_has_no_error_of_interpolation(reference):
    count = 8
    values = np.broadcast_to(((2 + np.arange(count)) / 8)[:, None, None], (count, 3, 4)).astype(
        np.float32
    )
    scene = reference(LAMP, values=values)
    low, high = scene.medium.low, scene.medium.high
    half = 0.5 * (high - low) / [4, 3, count]
    origin, end = np.random.default_rng(2).uniform(low + half, high - half, (2, 20, 3))
    length = np.linalg.norm(end - origin, axis=1)
    way = (end - origin) / length[:, None]
    found = field_of(scene).optical_depth(origin, way, np.zeros(20), length)
    height = (0.5 * (origin + end)[:, 2] - low[2]) / (high - low)[2] * count - 0.5
    np.testing.assert_allclose(
        found[:, 0], float(np.float32(SCALE)) * (2 + height) / 8 * length, rtol=1e-12
    )


@pytest.mark.claim("density-grid-refused", tolerance="none: an error and its words")
@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"more": '<string name="filter_type" value="nearest"/>'}, "filter_type 'trilinear'"),
        (
            {"values": SPIKE, "more": '<string name="filter_type" value="nearest"/>'},
            "filter_type 'trilinear'",
        ),
        ({"more": '<string name="wrap_mode" value="repeat"/>'}, "wrap_mode 'clamp'"),
        ({"turn": '<rotate z="1" angle="30"/>'}, "turns by right angles"),
        ({"values": np.repeat(ROUGH[..., None], 3, axis=3)}, "a grid of 3 channels"),
        ({"values": ROUGH - 0.5}, "expected finite numbers"),
        (
            {
                "albedo": (
                    '<volume type="gridvolume" name="albedo"><string name="filename" '
                    'value="FILE"/></volume>'
                )
            },
            "albedo",
        ),
    ],
)
def test_other_grids_are_refused_by_name(reference, tmp_path, how, words):
    if "albedo" in how:
        how = {"albedo": how["albedo"].replace("FILE", str(tmp_path / "smoke.vol"))}
    with pytest.raises(InputError, match=words):
        reference(LAMP, **how)


#: Faults that the comparison with volpath must find, by name.
FAULTS = {
    "values at the corners of voxels": Wrap(
        "airlight.reference.scene.varying:GridMedium.voxels",
        lambda function, self, point: function(self, point) + 0.5,
    ),
    "no attenuation on the way from the light": Wrap(
        "airlight.reference.quadrature.density_grid:CellWalk.leave",
        lambda function, *others: 0 * function(*others),
    ),
    "cells as thick as their first place": Wrap(
        "airlight.reference.quadrature.density_grid:CellWalk.within",
        lambda function, self, origin, way, x0, x1: (
            (x1 - x0) * self.density(origin + way * (x0 + 1e-6))
        ),
    ),
}


@pytest.mark.slow
@pytest.mark.claim(
    "density-grid-volpath", tolerance="0.5 % of the image, 95 % intervals of 40 batches"
)
def test_both_estimators_agree_and_injected_faults_are_found(reference):
    for light in (INSIDE, SUN):
        scene = reference(light)
        tracked = [single_scatter_batch(scene, seed, 256) for seed in range(3 * BATCHES)]
        exact = quadrature_image(scene, checks=0)
        assert all(abs(bias) + half < 0.005 for bias, half in biases(scene, exact, tracked))
        batches = [volpath_batch(scene, seed, 256) for seed in range(BATCHES)]

        def outside(changes=(), light=light, batches=batches):
            with injected(*changes):
                image = quadrature_image(
                    reference(light), checks=0, shadow_scale=1 - measure_shadow_epsilon()
                )
            found = biases(reference(light), image, batches)
            return [abs(bias) + half > 0.005 for bias, half in found]

        assert not any(outside())
        for name, change in FAULTS.items():
            assert any(outside([change])), name
