# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.scene.camera import ray_directions
from realtime.scene.read_scene import read_scene
from reference.scene.camera import film_positions, pixel_centres
from reference.scene.read import read_reference
from tests.helpers.scenes import spot, tiny_scene


def test_both_sides_read_the_same_scene(variant):
    """The reference and the methods under test read a scene by routes of their own; the numbers must be the same."""
    fog = tiny_scene()["fog"] | {"scale": 1.7, "phase": {"type": "hg", "g": -0.31}}
    scene = mi.load_dict(tiny_scene(fog=fog, spot=spot(cutoff=31.0, beam=17.0)))
    reference, other = read_reference(scene), read_scene(scene, "double")
    assert np.array(other.camera.origin).ravel() == pytest.approx(reference.origin)
    direction = np.array(ray_directions(other.camera, mi.UInt32(np.arange(reference.width * reference.height)))[0]).T
    assert np.max(np.abs(direction - reference.direction)) < 1e-14
    assert float(other.medium.sigma_t[0][0]) == pytest.approx(reference.medium.sigma_t[0], rel=1e-6)
    assert np.array(other.medium.albedo).ravel() == pytest.approx(reference.medium.albedo, rel=1e-6)
    assert reference.medium.phase.g == pytest.approx(-0.31)
    for mine, theirs in zip(reference.lights, other.lights, strict=True):
        assert mine.position == pytest.approx(np.array(theirs.position).ravel(), rel=1e-6)
        assert mine.intensity == pytest.approx(np.array(theirs.intensity).ravel(), rel=1e-6)
    cone = reference.lights[1]
    assert cone.axis == pytest.approx(np.array(other.lights[1].axis).ravel(), abs=1e-6)
    assert np.rad2deg([cone.cutoff, cone.beam]) == pytest.approx([31, 17])


@pytest.mark.claim("pixel-centre", tolerance="5e-7: Mitsuba's float32 matrices")
@pytest.mark.parametrize("principal", [(0.0, 0.0), (0.13, -0.07)])
def test_rays_are_those_of_mitsuba(variant, principal):
    size = (33, 21)
    scene = mi.load_dict(tiny_scene(size=size))
    parameters = mi.traverse(scene.sensors()[0])
    for axis, offset in zip("xy", principal):
        parameters[f"principal_point_offset_{axis}"] = offset
    parameters.update()
    reference = read_reference(scene)
    position = pixel_centres(size)
    film = mi.Point2f(*(position / size).T)
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, film, mi.Point2f(0.5))
    assert np.max(np.abs(np.array(ray.d).T - reference.direction)) < 5e-7  # float32 matrices on Mitsuba's side
    found = film_positions(scene.sensors()[0], np.concatenate([3 * reference.direction, -reference.direction]), size)
    np.testing.assert_allclose(found[: len(position)], position, rtol=0, atol=1e-11)
    assert np.isnan(found[len(position) :]).all()


@pytest.mark.claim("scenes-refused-by-name")
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lamp": None}, "no light"),
        ({"lamp": None, "sky": {"type": "constant"}}, "light 'sky' is a sky: nothing of it arrives"),
    ],
)
def test_refusals(variant, changes, message):
    with pytest.raises(InputError, match=message):
        read_reference(mi.load_dict(tiny_scene(**changes)))
