# SPDX-License-Identifier: BSD-3-Clause
"""Closed forms of fog shading: what shaders print, thin fog, and how much too
bright their ambient light is.
"""

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.camera import film_directions, pixel_centres
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.height_fog import LAMP, SUN, fog_xml

SKY = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.2, 0.3, 0.4"/></emitter>'
DARK = SUN.replace("3, 2.6, 2.1", "0, 0, 0")
DENSITY, FALLOFF, BASE = 0.09, 0.17, 0.3  # of Unreal: per 1000 cm, base 2, and a height in metres
LAYER = f"""<volume type="heightfog" name="sigma_t"><string name="engine" value="unreal"/>
    <float name="FogDensity" value="{DENSITY}"/><float name="FogHeightFalloff" value="{FALLOFF}"/>
    <float name="FogHeight" value="{BASE}"/>
    <transform name="to_world"><scale value="3000"/><translate x="-1500" y="-1500" z="-0.5"/></transform></volume>"""


@pytest.fixture
def scene(variant, tmp_path):
    def load(*parts, fog=LAYER, change=lambda text: text):
        path = tmp_path / "fog.xml"
        path.write_text(change(fog_xml(*parts, size=(8, 6), fog=fog)))
        return load_scene(str(path)).scene

    return load


def shown(loaded, form, kernel=None):
    frame = frame_renderer(read_scene(loaded), METHODS["unshadowed"], kernel=kernel, form=form)
    return render_frame(frame)


@pytest.mark.claim(
    "fog-colours", tolerance="1e-4 relative: float32, and the series of the shader is exact here"
)
def test_colours_are_what_shaders_print(scene):
    # The sun stands before the camera, where its lobe is.
    ahead = SUN.replace('x="0.5" y="0.3" z="-0.45"', 'x="-0.5" y="-0.2" z="-0.3"')
    loaded = scene(ahead, SKY)
    sensor = loaded.sensors()[0]
    ways = film_directions(sensor, pixel_centres((8, 6)), (8, 6)).reshape(6, 8, 3)
    towards = np.array([0.5, 0.2, 0.3]) / np.linalg.norm([0.5, 0.2, 0.3])
    sky, sun, albedo = (
        np.array([0.2, 0.3, 0.4]),
        np.array([3, 2.6, 2.1]),
        np.array([0.9, 0.85, 0.7]),
    )
    cosine = np.maximum(ways @ towards, 0)[..., None]
    assert cosine.max() > 0.98 > 0.7 > cosine.min()
    for form, lobe in (("wenzel", 1), ("quilez", 18 * cosine**8), ("unreal", 10 * cosine**4)):
        frame = shown(loaded, form)
        ends = np.where(ways[..., 2] > 0, 2999.5 - 2.3, 2.3 + 0.5) / np.abs(ways[..., 2])
        length = np.minimum(np.asarray(frame.distance, dtype=np.float64), ends)
        # HeightFogCommon.ush, in cm: density and falloff over 1000, 2^-x for both.
        fall = 100 * FALLOFF / 1000 * ways[..., 2] * length
        line = (
            DENSITY
            / 1000
            * 2 ** (-100 * FALLOFF / 1000 * (2.3 - BASE))
            * (1 - 2**-fall)
            / fall
            * 100
            * length
        )
        amount = 1 - 2**-line
        # (a/b) exp(-b y) (1 - exp(-b t dy))/dy, with the a and b of the same fog
        if form == "quilez":
            a, b = np.log(2) ** 2 * DENSITY / 10, np.log(2) * FALLOFF / 10
            amount = np.minimum(
                a
                / b
                * np.exp(-b * (2.3 - BASE))
                * (1 - np.exp(-b * length * ways[..., 2]))
                / ways[..., 2],
                1,
            )
        expected = albedo * (sky + sun * lobe / (4 * np.pi)) * amount[..., None]
        np.testing.assert_allclose(frame.airlight, expected, rtol=1e-4)


@pytest.mark.claim(
    "fog-colours", tolerance="0.5 %: the optical depth to the sun in fog a thousandth as dense"
)
def test_one_colour_is_the_airlight_of_thin_fog_that_scatters_evenly(scene):
    def thin(text):
        even = '<phase type="isotropic"/><float name="scale" value="0.001"/>'
        return text.replace('<phase type="hg"><float name="g" value="0.35"/></phase>', even)

    loaded = scene(SUN, change=thin)
    np.testing.assert_allclose(
        shown(loaded, "wenzel").airlight,
        shown(loaded, "airlight", KERNELS["exact"]).airlight,
        rtol=5e-3,
    )


@pytest.mark.claim("fog-colours", tolerance="by name")
def test_local_lights_alone_are_refused(scene):
    with pytest.raises(InputError, match="form=unreal: a fog colour has no term for local lights"):
        shown(scene(LAMP), "unreal")


def test_a_local_light_beside_a_sun_is_refused(scene):
    with pytest.raises(InputError, match="and the scene has one of kind 'point'"):
        shown(scene(SUN, LAMP), "wenzel")


@pytest.mark.slow
@pytest.mark.claim("fog-colours", tolerance="a factor of 2 to 8 in the mean")
def test_ambient_light_over_ground_is_too_bright(scene):
    loaded = scene(DARK, SKY)
    exact_light = quadrature_image(read_reference(loaded), checks=0).airlight.mean()
    assert 2 < shown(loaded, "wenzel").airlight.mean() / exact_light < 8
