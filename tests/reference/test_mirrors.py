# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a mirror shows area lights and a sky, by the quadrature, by `single-scatter` and by
`volpath`, as the image of the light behind the mirror says.

No sample of a light meets the one direction of a mirror: surfaces under such lights were dark in
them, with an error of zero.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference

MIRROR = {"type": "conductor", "material": "none"}  # reflects all light
SIGMA_T = np.array([0.05, 0.1, 0.2])  # [1/m]
RADIANCE = np.array([5.0, 4.0, 3.0])  # [W/(m^2 sr)]
EYE, LAMP, HALF = np.array([0.0, -4.0, 1.5]), np.array([0.2, 1.0, 2.5]), 0.8  # [m]
SIZE = (24, 18)


def rgb(values):
    return {"type": "rgb", "value": [float(each) for each in values]}


def fog():
    return {"type": "homogeneous", "sigma_t": rgb(SIGMA_T), "albedo": 0.5}


def camera(**medium):
    looks = mi.ScalarTransform4f().look_at(EYE.tolist(), [0, 0, 0], [0, 0, 1])
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}}
    return {"type": "perspective", "fov": 60.0, "to_world": looks, "film": film, **medium}


def mirror(material):
    """Return a mirror in the plane z = 0, which faces up."""
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(3.0), "bsdf": material}


def under_a_lamp(kind="rectangle", material=MIRROR):
    """Return a mirror under a lamp that faces down, in fog without bounds."""
    place = mi.ScalarTransform4f().translate(LAMP.tolist())
    turned = place.rotate([1, 0, 0], 180.0).scale(HALF)
    lamp = {
        "type": kind,
        "to_world": turned,
        "emitter": {"type": "area", "radiance": rgb(RADIANCE)},
    }
    black = {"type": "diffuse", "reflectance": 0.0}
    medium = fog()
    return read_reference(
        mi.load_dict(
            {
                "type": "scene",
                "sensor": camera(medium=medium),
                "mirror": mirror(material),
                "lamp": lamp | {"bsdf": black},
            }
        )
    )


def under_a_sky(radius=5.0):
    """Return a mirror in a ball of fog about the origin, with the camera, under a sky."""
    medium = mi.load_dict(fog())
    ball = {"type": "sphere", "radius": radius, "bsdf": {"type": "null"}, "interior": medium}
    return read_reference(
        mi.load_dict(
            {
                "type": "scene",
                "sensor": camera(medium=medium),
                "mirror": mirror(MIRROR),
                "fog": ball,
                "sky": {"type": "constant", "radiance": rgb(RADIANCE)},
            }
        )
    )


def on_the_mirror(direction):
    """Return where rays meet the mirror, how far that is, and which rays do."""
    with np.errstate(divide="ignore"):
        far = -EYE[2] / direction[:, 2]
    place = EYE + far[:, None] * direction
    return place, far, (far > 0) & (np.abs(place[:, :2]) < 3.0).all(axis=1)


def image_of_the_lamp(direction, kind):
    """Return the radiance of the lamp's image below the mirror, and the pixels on its edge."""
    _, _, meets = on_the_mirror(direction)
    far = -(EYE[2] + LAMP[2]) / np.where(meets, direction[:, 2], -1.0)
    x, y = (EYE + far[:, None] * direction - LAMP)[:, :2].T / HALF
    out = np.hypot(x, y) if kind == "disk" else np.maximum(np.abs(x), np.abs(y))
    shown = RADIANCE * np.exp(-SIGMA_T * far[:, None])
    return np.where((meets & (out < 1))[:, None], shown, 0.0), np.abs(out - 1) < 1e-4


def image_of_the_sky(direction, radius=5.0):
    """Return the radiance of a sky in the mirror, through the ball of fog."""
    place, far, meets = on_the_mirror(direction)
    onwards = direction * [1, 1, -1]
    # All of both ways is in the fog.
    along = np.sum(place * onwards, axis=1)
    rest = -along + np.sqrt(along**2 - np.sum(place**2, axis=1) + radius**2)
    shown = RADIANCE * np.exp(-SIGMA_T * (far + rest)[:, None])
    return np.where(meets[:, None], shown, 0.0)


@pytest.mark.claim("mirrors")
@pytest.mark.parametrize("kind", ["rectangle", pytest.param("disk", marks=pytest.mark.slow)])
def test_a_mirror_shows_the_image_of_a_lamp(variant, kind):
    reference = under_a_lamp(kind)
    expected, edge = image_of_the_lamp(reference.direction, kind)
    assert (expected > 0).any()
    got = quadrature_image(reference)
    surface, error = got.surface.reshape(-1, 3), got.surface_error.reshape(-1, 3)
    np.testing.assert_allclose(surface[~edge], expected[~edge], rtol=2e-6, atol=1e-12)
    assert np.all(error[expected > 0] > 0)
    traced = single_scatter_batch(reference, 0, 16).mean[1].reshape(-1, 3)
    # Single precision, and a way that starts a hair before the lamp: 1.5e-5 in blue.
    np.testing.assert_allclose(traced[~edge], expected[~edge], rtol=1e-4, atol=1e-6)


@pytest.mark.slow
@pytest.mark.claim("mirrors")
def test_a_mirror_shows_a_sky(variant):
    reference = under_a_sky()
    expected = image_of_the_sky(reference.direction)
    got = quadrature_image(reference).surface.reshape(-1, 3)
    np.testing.assert_allclose(got, expected, rtol=2e-6, atol=1e-12)
    traced = single_scatter_batch(reference, 0, 16).mean[1].reshape(-1, 3)
    np.testing.assert_allclose(traced, expected, rtol=1e-4, atol=1e-6)


@pytest.mark.statistical
@pytest.mark.claim("mirrors")
@pytest.mark.parametrize("scene", [under_a_lamp, under_a_sky])
def test_mitsubas_path_tracer_sees_the_same_mirror(variant, scene):
    reference = scene()
    traced = volpath_batch(reference, 0, 256)
    for seed in range(1, 24):
        traced = merged(traced, volpath_batch(reference, seed, 256))
    exact = quadrature_image(reference).surface.mean(axis=(0, 1))
    totals = traced.totals[:, 1]
    error = totals.std(axis=0, ddof=1) / np.sqrt(len(totals))
    assert np.all(np.abs(totals.mean(axis=0) - exact) < 4 * error)
    assert np.all(error < 0.01 * exact)


def test_a_mirror_that_is_mixed_with_another_material_is_refused(variant):
    grey = {"type": "diffuse", "reflectance": 0.5}
    mixed = {"type": "blendbsdf", "weight": 0.3, "one": grey, "other": MIRROR}
    with pytest.raises(InputError, match="shape 'mirror' blends a mirror"):
        quadrature_image(under_a_lamp(material=mixed))


@pytest.mark.parametrize("eta", [1.9, pytest.param(1.33, marks=pytest.mark.slow)])
def test_glass_shows_what_fresnel_reflects(variant, eta):
    glass = {"type": "dielectric", "int_ior": eta, "ext_ior": 1.0}
    reference = under_a_lamp(material=glass)
    whole, edge = image_of_the_lamp(reference.direction, "rectangle")
    # Fresnel's equations for the cosine at which a ray meets the pane, and that within it.
    cosine = np.abs(reference.direction[:, 2])
    within = np.sqrt(1 - (1 - cosine**2) / eta**2)
    across = (cosine - eta * within) / (cosine + eta * within)
    along = (eta * cosine - within) / (eta * cosine + within)
    expected = (0.5 * (across**2 + along**2))[:, None] * whole
    got = quadrature_image(reference).surface.reshape(-1, 3)
    np.testing.assert_allclose(got[~edge], expected[~edge], rtol=5e-6, atol=1e-12)


@pytest.mark.slow
def test_varnish_is_a_mirror_over_paint(variant):
    """Both routes, which share no sample of the lamp."""
    reference = under_a_lamp(material={"type": "plastic"})
    traced = single_scatter_batch(reference, 0, 256).mean[1].mean(axis=0)
    exact = quadrature_image(reference).surface.mean(axis=(0, 1))
    np.testing.assert_allclose(traced, exact, rtol=0.01)  # of 256 samples a pixel
