# SPDX-License-Identifier: BSD-3-Clause
"""Claim: octaves are what their formula says; clouds dim what lies behind and below
them; others refuse clouds.
"""

from dataclasses import replace
from functools import partial

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.clouds.canonical.coordinates import OPACITY
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.scene.animate import thicker_medium
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.read_scene import describe, read_scene
from airlight.validation.scenes.meshes import box, grid, placed
from airlight.validation.scenes.parts import mitsuba_mesh
from tests.helpers.clouds import DROPLETS, SUN, cloud, cloud_scene, loaded, ring
from tests.helpers.frames import render

pytestmark = pytest.mark.usefixtures("variant")

OCTAVES = METHODS["cloud-octaves"]
SKY = {"type": "constant", "radiance": {"type": "rgb", "value": [0.13, 0.22, 0.41]}}
SIGMA = 0.0363


rendered = partial(render, method=OCTAVES)


def directions(scene):
    """Return the unit directions of the rays of a Mitsuba scene of 16 x 12 pixels, (12, 16, 3)."""
    pixel = mi.UInt32(np.arange(16 * 12, dtype=np.uint32))
    return np.array(ray_directions(read_scene(scene, "double").camera, pixel)[0]).T.reshape(
        12, 16, 3
    )


def slab(thickness=31.7, size=9000.0, middle=0.0):
    return placed(box((size, size, thickness)), (11.3, -7.9, middle))


@pytest.mark.claim("octaves", tolerance="5e-4 relative: 48 steps in float32")
@pytest.mark.parametrize("precision", ["single", "double"])
def test_octaves_in_a_slab_are_their_integrals(precision):
    """Seen from above, octave n is b^n P_n mu0/(mu0 + a^n mu) (1 - exp(-tau
    (1/mu + a^n/mu0)))/(4 pi).
    """
    scene = mi.load_dict(
        cloud_scene(origin=(30.0, -400.0, 700.0), sun=SUN, slab=cloud("slab", slab()))
    )
    numbers = {"octaves": 3, "extinction": 0.4, "contribution": 0.3, "anisotropy": 0.6, "steps": 48}
    frame = rendered(scene, precision=precision, extra_layers=True, **numbers)
    direction = directions(scene)
    travels = np.array(SUN["direction"]) / np.linalg.norm(SUN["direction"])
    mu, mu0, cosine = -direction[..., 2:], -travels[2], -(direction @ travels)[..., None]
    tau, expected = SIGMA * 31.7, []
    for octave in range(3):
        a, b, g = 0.4**octave, 0.3**octave, 0.85 * 0.6**octave
        phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
        fraction = mu0 / (mu0 + a * mu) * (1 - np.exp(-tau * (1 / mu + a / mu0)))
        expected.append(np.array([3.1, 2.9, 2.3]) * b * phase / (4 * np.pi) * fraction)
    assert frame.airlight == pytest.approx(sum(expected), rel=5e-4)
    assert list(frame.extra) == ["airlight_1", "airlight_2", "airlight_3_4", OPACITY]
    for name, octave in zip(frame.extra, expected):
        assert frame.extra[name] == pytest.approx(octave, rel=5e-4)
    assert frame.extra[OPACITY] == pytest.approx(
        np.broadcast_to(1 - np.exp(-tau / mu), (12, 16, 3)), rel=1e-4
    )


@pytest.mark.claim("cloud-layers")
def test_layers_cost_nothing_and_change_nothing_where_nobody_asks():
    scene = loaded()
    asked, plain = (rendered(scene, extra_layers=asked, octaves=12) for asked in (True, False))
    assert plain.extra == {}
    np.testing.assert_array_equal(asked.airlight, plain.airlight)
    orders = [values for name, values in asked.extra.items() if name != OPACITY]
    assert len(orders) == 6
    assert sum(orders) == pytest.approx(asked.airlight, rel=1e-5)


def test_the_sky_is_seen_through_clouds_and_lights_them_from_above():
    """A sky alone: behind it shines L, and as a beam the slab gets pi L from above."""
    parts = {"origin": (30.0, -40.0, 700.0), "sky": SKY, "slab": cloud("slab", slab())}
    frame = rendered(mi.load_dict(cloud_scene(**parts)), octaves=1, sky="beams", extra_layers=True)
    sky = np.array(SKY["radiance"]["value"])
    assert frame.surface == pytest.approx((1 - frame.extra[OPACITY]) * sky, rel=1e-5)
    down = SUN | {
        "direction": [0, 0, -1.0],
        "irradiance": {"type": "rgb", "value": list(np.pi * sky)},
    }
    lit = rendered(mi.load_dict(cloud_scene(**(parts | {"sky": down}))), octaves=1)
    assert frame.airlight == pytest.approx(lit.airlight, rel=1e-5)
    assert lit.surface.max() == 0


def test_light_that_came_through_a_cloud_falls_on_the_ground():
    """Under a slab the ground has rho E mu0/pi exp(-tau/mu0); a part
    beyond its edge has all of it.
    """
    ground = mitsuba_mesh(
        "ground", grid((-4000, -4000, -200), (8000, 0, 0), (0, 8000, 0), (1, 1)), (0.4, 0.3, 0.2)
    )
    origin = (30.0, -300.0, 350.0)
    scene = mi.load_dict(
        cloud_scene(origin=origin, sun=SUN, slab=cloud("slab", slab()), ground=ground)
    )
    frame = rendered(scene)
    mu0 = 0.619 / np.linalg.norm(SUN["direction"])
    full = np.array([0.4, 0.3, 0.2]) * np.array([3.1, 2.9, 2.3]) * mu0 / np.pi
    through = np.exp(-SIGMA * 31.7 * (1 / mu0 + 1 / -directions(scene)[..., 2:]))
    assert frame.surface == pytest.approx(full * through, rel=3e-4)
    away = cloud_scene(
        origin=origin, sun=SUN, ring=cloud("ring", ring((3000.0, 0.0, 900.0))), ground=ground
    )
    assert rendered(mi.load_dict(away)).surface[-1] == pytest.approx(
        np.tile(full, (16, 1)), rel=1e-5
    )


def test_surfaces_shadow_clouds():
    """A roof over the slab takes all light of the sun."""
    roof = mitsuba_mesh(
        "roof", grid((-4e4, -4e4, 900), (8e4, 0, 0), (0, 8e4, 0), (1, 1)), (0.4, 0.3, 0.2)
    )
    scene = cloud_scene(origin=(30.0, -40.0, 700.0), sun=SUN, slab=cloud("slab", slab()), roof=roof)
    assert rendered(mi.load_dict(scene)).airlight.max() == 0


@pytest.mark.parametrize(
    ("origin", "sun", "axis"),
    [
        ((30.0, -400.0, 57.0), True, "z"),  # level
        ((30.0, -40.0, 700.0), True, "z"),  # steeply down
        ((3.17, -300.0, 300.0), True, "z"),  # down along an axis, where the sun decides
        ((3.17, -100.0, 300.0), False, "y"),  # and without a sun the image
    ],
)
def test_up_is_what_is_upright_in_the_image(origin, sun, axis):
    parts = ({"sun": SUN} if sun else {}) | {"sky": SKY, "ring": cloud("ring", ring())}
    lights = describe(read_scene(mi.load_dict(cloud_scene(origin=origin, **parts))))["lights"]
    assert lights.endswith(f"a sky, as a beam from {axis}")


@pytest.mark.parametrize(("sign", "phase"), [(1, "hg:0.95"), (-1, "hg-draine:12")])
def test_the_sun_in_the_axis_of_the_view(sign, phase):
    """Scattering angles of 0 and 180 degrees exactly: the eye looks into
    the sun, or has it behind.
    """
    scene = loaded()
    middle = directions(scene)[6, 8]
    sun = SUN | {"direction": (-sign * middle).tolist()}
    frame = rendered(loaded(sun=sun, ring=cloud("ring", ring())), phase=phase)
    assert np.isfinite(frame.airlight).all()
    assert frame.airlight.min() >= 0
    if phase == "hg:0.95":
        assert (frame.airlight.max() > 1) == (sign == 1)


LAMP = {"type": "point", "position": [0.0, 0.0, 300.0], "intensity": {"type": "rgb", "value": 9.0}}


@pytest.mark.claim("clouds-refused")
def test_what_is_not_lit_from_infinity_is_refused():
    with pytest.raises(
        InputError,
        match="cloud-octaves: the scene has a light of kind point, and clouds are lit from",
    ):
        rendered(loaded(sun=SUN, lamp=LAMP, ring=cloud("ring", ring())))
    panel = {
        "type": "rectangle",
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 3.0}},
    }
    with pytest.raises(InputError, match=r"a light of kind area \(rectangle\)"):
        rendered(loaded(sun=SUN, panel=panel, ring=cloud("ring", ring())))


@pytest.mark.claim("clouds-refused", "media-refused")
@pytest.mark.parametrize("name", FOG_METHODS)
def test_methods_for_fog_refuse_clouds_and_skies_and_name_who_takes_them(name):
    method = METHODS[name]
    kernel = {"kernel": KERNELS["exact"]} if method().uses_kernel else {}
    wanted = rf"method {name}: .*use cloud-collectors or cloud-octaves"
    with pytest.raises(InputError, match=wanted):
        frame_renderer(read_scene(loaded()), method, **kernel)
    with pytest.raises(InputError, match=wanted):
        frame_renderer(
            read_scene(loaded(sun=SUN, sky=SKY, slab=cloud("slab", slab()))), method, **kernel
        )


def test_frames_after_the_sun_moved_and_the_cloud_thickened():
    """One recording serves all frames, with their layers."""
    read = read_scene(loaded(sun=SUN, sky=SKY, ring=cloud("ring", ring())))
    renderer = frame_renderer(read, OCTAVES, extra_layers=True)
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    stages, cache = next_frame(renderer, read, None, **still)
    first = image_frame(renderer, stages, cache.extra)
    np.testing.assert_array_equal(first.airlight, render_frame(renderer).airlight)
    thick = replace(read, medium=thicker_medium(read.medium, 2.0))
    stages, cache = next_frame(renderer, thick, cache, **still)
    now = image_frame(renderer, stages, cache.extra)
    new = rendered(
        loaded(sun=SUN, sky=SKY, ring=cloud("ring", ring(), DROPLETS | {"sigma_t": 2 * SIGMA}))
    )
    assert now.airlight == pytest.approx(new.airlight, rel=1e-4, abs=1e-7)
    assert now.extra[OPACITY].mean() > first.extra[OPACITY].mean()
