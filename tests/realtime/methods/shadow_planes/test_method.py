# SPDX-License-Identifier: BSD-3-Clause
"""Frames of shadow planes against the quadrature truth on exact geometry, which shares no code with them."""

import numpy as np
import pytest

from realtime.errors import InputError
from tests.helpers.casters import ALL, SOUND
from tests.helpers.scenes import spot, tiny_scene
from validation.scenes.parts import joined, mitsuba_mesh

SHIFT = np.array([0.0, 0.0, 0.9])


def lamp(position):
    return {"type": "point", "position": list(position), "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}


def sensor(origin, target):
    import mitsuba as mi

    look = mi.ScalarTransform4f().look_at(list(origin), list(target), [0, 0, 1])
    return tiny_scene()["sensor"] | {"to_world": look}


def coloured_fog():
    return {
        "type": "homogeneous",
        "id": "fog",
        "sigma_t": {"type": "rgb", "value": [0.1, 0.4, 0.9]},
        "albedo": 0.83,
        "phase": {"type": "hg", "g": 0.53},
    }


CHANGES = {
    "light inside": lambda: {"lamp": lamp((0.13, -0.07, 1.09))},
    "camera inside": lambda: {"sensor": sensor((0.1, 0.02, 1.05), (0, 1, 0.9))},
    "camera in shadow": lambda: {"sensor": sensor((-0.5, -0.6, 0.25), (2, 1.5, 0.9))},
    "towards the light": lambda: {"sensor": sensor((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9))},
    "away from the light": lambda: {"sensor": sensor((1.7, 1.6, 2.9), (-0.9, -0.7, -0.1))},
    "camera close to the light": lambda: {"sensor": sensor((0.9, 0.7001, 1.9), (0, 0, 0.9))},
    "colour, HG": lambda: {"fog": coloured_fog()},
    "hard spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "three lights": lambda: {"second": lamp((-1, 1.4, 0.6)), "third": spot(beam=11.0)},
}


def scene_with(mesh, *, size=(24, 18), **changes):
    import mitsuba as mi

    scene = tiny_scene(ball=None, **changes)
    film = scene["sensor"]["film"] | {"width": size[0], "height": size[1]}
    scene["sensor"] = scene["sensor"] | {"film": film}
    if mesh is not None:
        vertices, faces = mesh
        scene["caster"] = mitsuba_mesh("caster", (vertices + SHIFT, faces), (0.5, 0.4, 0.3))
    return mi.load_dict(scene)


def planes(scene, precision="single", **parameters):
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    method = METHODS["shadow-planes"]
    kernel = KERNELS["exact"].function
    return render_frame(frame_renderer(read_scene(scene, precision), method, kernel=kernel, **parameters))


def truth(scene):
    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth

    return quadrature_image(read_truth(scene), edges="geometry")


def assert_is_truth(frame, image, *, rmse=1e-5):
    """Relative RMSE, all but one value in two hundred within 1e-3 (one ray may pass an edge), none negative, no NaN."""
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
    """The share of pixels whose surface is lit in one and dark in the other.

    The truth's shadow rays start 1e-4 m above the surface and are cast in float32: at the edge of a shadow they and the
    planes may differ by a pixel.
    """
    return np.mean(np.any(np.abs(frame.surface - image.surface) > 1e-2 * image.surface.mean(), axis=2))


@pytest.mark.claim("planes-are-exact", tolerance="relative RMSE 5e-6: float32")
@pytest.mark.parametrize("name", ALL)
def test_every_mesh(variant, name):
    scene = scene_with(ALL[name]())
    frame, image = planes(scene), truth(scene)
    # float32 kernels and crossings: 1e-6, a hundredth of what is asked of a frame.
    assert_is_truth(frame, image, rmse=5e-6)
    assert surface_differs(frame, image) < 0.005


@pytest.mark.claim("planes-are-exact")
@pytest.mark.parametrize("change", CHANGES)
def test_every_place_and_light(variant, change):
    scene = scene_with(SOUND["torus"](), **CHANGES[change]())
    frame, image = planes(scene), truth(scene)
    assert_is_truth(frame, image)
    assert surface_differs(frame, image) < 0.005


@pytest.mark.claim("planes-are-exact")
@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", sorted(set(ALL) - {"torus"}))
def test_every_mesh_in_every_place_and_light(variant, name, change):
    scene = scene_with(ALL[name](), **CHANGES[change]())
    frame, image = planes(scene), truth(scene)
    assert_is_truth(frame, image)


def test_light_behind_slats(variant):
    """Deep stacks: forty slats before one another, three hundred planes in many a tile."""
    from validation.scenes.solids import box

    slats = []
    for number in range(40):
        vertices, faces = box((0.9, 0.013, 0.031))
        place = np.array([0.07, -0.6 + 0.03 * number, 0.011 * (number % 7)])
        slats.append((vertices + place, faces))
    scene = scene_with(joined(slats), lamp=lamp((0.2, 1.4, 1.1)))
    frame, image = planes(scene), truth(scene)
    assert_is_truth(frame, image)
    # Half of the light is taken: the scene is worth its name.
    assert frame.airlight.mean() < 0.9 * planes(scene_with(None, lamp=lamp((0.2, 1.4, 1.1)))).airlight.mean()


def test_double_precision_is_nearer_to_the_truth(variant):
    scene = scene_with(SOUND["torus"]())
    image = truth(scene)
    # What is left is the distance to the surface, which is cast in float32.
    assert_is_truth(planes(scene, "double"), image, rmse=5e-7)


@pytest.mark.claim("enclosed-light")
def test_enclosed_light_is_black(variant):
    """No silhouette, and all beyond the caster dark."""
    frame = planes(scene_with(SOUND["sphere"](), lamp=lamp((0.13, -0.07, 1.09))))
    assert np.all(frame.airlight == 0)
    assert np.all(frame.surface == 0)


@pytest.mark.claim("orders-of-the-planes")
def test_order_none_shows_the_artefact(variant):
    """Fig. 4: a sphere within a sphere takes its share of the light twice."""
    scene = scene_with(SOUND["nested spheres"]())
    image = truth(scene)
    error = planes(scene, order="none").airlight - image.airlight
    assert np.sqrt(np.mean(error**2)) > 0.01 * image.airlight.mean()
    assert error.min() < -0.05 * image.airlight.mean()


@pytest.mark.claim("flawed-meshes-warn")
@pytest.mark.parametrize("name", ["open cylinder", "mixed winding"])
def test_folds_of_open_meshes_count_twice_without_an_order(variant, name):
    scene = scene_with(ALL[name]())
    image = truth(scene)
    error = planes(scene, order="none").airlight - image.airlight
    assert np.sqrt(np.mean(error**2)) > 1e-3 * image.airlight.mean()


def test_ambient_light_is_added_by_its_formula(variant):
    scene = scene_with(SOUND["sphere"]())
    without, with_it = planes(scene, "double"), planes(scene, "double", ambient=0.23)
    depth = 0.31 * np.minimum(without.distance, 1e30)
    expected = 0.23 * np.array([0.9, 0.8, 0.7]) * (1 - np.exp(-depth))[..., None]
    assert with_it.airlight - without.airlight == pytest.approx(expected, rel=1e-5)


@pytest.mark.claim("shapes-without-edges-refused")
def test_shapes_without_triangles_are_refused_by_name(variant):
    import mitsuba as mi

    with pytest.raises(InputError, match="shape 'ball' is a Sphere"):
        planes(mi.load_dict(tiny_scene()))
