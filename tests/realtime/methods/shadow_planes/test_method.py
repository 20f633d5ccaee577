# SPDX-License-Identifier: BSD-3-Clause
"""Frames of shadow planes against the quadrature reference on exact geometry, which
shares no code with them.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.parts import mitsuba_mesh
from tests.helpers.frames import read, render, renderer
from tests.helpers.light_frames import camera, coloured_fog, lamp
from tests.helpers.occluders import ALL, SOUND
from tests.helpers.scenes import spot, tiny_scene

#: Places of lights about which a torus has other numbers of wedges [m].
NEAR, FAR = (0.4, 0.0, 0.9), (-1.0, 1.4, 6.6)
SHIFT = np.array([0.0, 0.0, 0.9])


CHANGES = {
    "light inside": lambda: {"lamp": lamp(0.13, -0.07, 1.09)},
    "camera inside": lambda: camera((0.1, 0.02, 1.05), (0, 1, 0.9)),
    "camera in shadow": lambda: camera((-0.5, -0.6, 0.25), (2, 1.5, 0.9)),
    "towards the light": lambda: camera((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9)),
    "away from the light": lambda: camera((1.7, 1.6, 2.9), (-0.9, -0.7, -0.1)),
    "camera close to the light": lambda: camera((0.9, 0.7001, 1.9), (0, 0, 0.9)),
    "colour, HG": lambda: {"fog": coloured_fog()},
    "hard spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "three lights": lambda: {"second": lamp(-1, 1.4, 0.6), "third": spot(beam=11.0)},
}


def scene_with(mesh, *, size=(24, 18), **changes):
    scene = tiny_scene(ball=None, **changes)
    film = scene["sensor"]["film"] | {"width": size[0], "height": size[1]}
    scene["sensor"] = scene["sensor"] | {"film": film}
    if mesh is not None:
        vertices, faces = mesh
        scene["occluder"] = mitsuba_mesh("occluder", (vertices + SHIFT, faces), (0.5, 0.4, 0.3))
    return mi.load_dict(scene)


def reference(scene):
    return quadrature_image(read_reference(scene))


def assert_is_reference(frame, image, *, rmse=1e-5):
    """Relative RMSE, all but one value in two hundred within 1e-3 (one ray may pass an
    edge), none negative, no NaN.
    """
    mean = image.airlight.mean()
    if mean == 0:
        assert np.all(frame.airlight == 0)
        return
    error = frame.airlight - image.airlight
    assert np.sqrt(np.mean(error**2)) < rmse * mean
    relative = np.abs(error) / np.maximum(image.airlight, 1e-3 * mean)
    assert np.mean(relative > 1e-3) < 0.005
    assert frame.airlight.min() > -1e-5 * mean


def surface_differs(frame, image):
    """The fraction of pixels whose surface is lit in one and dark in the other.

    The reference's shadow rays start 1e-4 m above the surface and are cast in float32: at the edge
    of a shadow they and the planes may differ by a pixel.
    """
    return np.mean(
        np.any(np.abs(frame.surface - image.surface) > 1e-2 * image.surface.mean(), axis=2)
    )


@pytest.mark.claim("planes-are-exact", tolerance="relative RMSE 5e-6: float32")
@pytest.mark.parametrize("name", ALL)
def test_every_mesh(variant, name):
    scene = scene_with(ALL[name]())
    frame, image = render(scene, "shadow-planes"), reference(scene)
    # float32 kernels and crossings: 1e-6, a hundredth of what is asked of a frame.
    assert_is_reference(frame, image, rmse=5e-6)
    assert surface_differs(frame, image) < 0.005


@pytest.mark.claim("planes-are-exact")
@pytest.mark.parametrize("change", CHANGES)
def test_every_place_and_light(variant, change):
    scene = scene_with(SOUND["torus"](), **CHANGES[change]())
    frame, image = render(scene, "shadow-planes"), reference(scene)
    assert_is_reference(frame, image)
    assert surface_differs(frame, image) < 0.005


@pytest.mark.claim("enclosed-light")
def test_enclosed_light_is_black(variant):
    """No silhouette, and all beyond the occluder dark."""
    frame = render(scene_with(SOUND["sphere"](), lamp=lamp(0.13, -0.07, 1.09)), "shadow-planes")
    assert np.all(frame.airlight == 0)
    assert np.all(frame.surface == 0)


@pytest.mark.parametrize("first", [0, 1])
def test_two_lights_are_the_sum_of_each(variant, first):
    """The planes of a near light lie in other wedges than those of a far one, and in another
    number of them: a recording takes no number of the first light for the second one's."""
    scene = read(scene_with(SOUND["torus"](), lamp=lamp(*NEAR), more=lamp(*FAR)))
    wedges = [
        float(np.array(state[0].scale)[0])
        for state in renderer(scene, "shadow-planes").prepare(scene)
    ]
    assert wedges[0] != wedges[1]
    lights = scene.lights if first == 0 else scene.lights[::-1]
    whole = render(replace(scene, lights=lights), "shadow-planes").airlight
    parts = [render(replace(scene, lights=(light,)), "shadow-planes").airlight for light in lights]
    np.testing.assert_allclose(whole, sum(parts), rtol=1e-5, atol=1e-6 * whole.max())
