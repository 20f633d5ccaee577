# SPDX-License-Identifier: BSD-3-Clause
"""Height fog of Mitsuba's volume and of engines' parameters: its density, what it
refuses, and that readers agree.
"""

import math

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.height_fog import HeightFog, Layer
from airlight.errors import InputError
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.engine_fog import ENGINES, fog_of_engine, parameters_of
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.loading import load_scene
from tests.helpers.height_fog import FOG, LAMP, SPOT, SUN, fog_xml


@pytest.fixture
def loaded(variant, tmp_path):
    def load(text):
        path = tmp_path / "fog.xml"
        path.write_text(text)
        return load_scene(str(path)).scene

    return load


def _extinction(medium, points):
    interaction = mi.MediumInteraction3f()
    interaction.p = mi.Point3f(np.asarray(points, dtype=np.float32).T)
    return np.array(medium.get_scattering_coefficients(interaction)[2]).reshape(3, -1)[0]


@pytest.mark.parametrize("clamped", ["", '<boolean name="clamped" value="true"/>'])
def test_mitsuba_and_the_reference_have_one_density(loaded, clamped):
    constant = '<float name="sigma_0" value="0.004"/><float name="z_1" value="1.7"/>'
    fog = FOG.replace('<float name="z_1" value="0.3"/>', constant + clamped)
    scene = loaded(fog_xml(LAMP, fog=fog + '<float name="scale" value="1.3"/>'))
    medium = read_reference(scene).medium
    z = np.linspace(-1, 44, 181)
    found = _extinction(medium.plugin, np.stack([z * 7, 300 - z, z], axis=1))
    np.testing.assert_allclose(found, fog_of(medium).density(z), rtol=3e-6)  # float32 in Mitsuba
    majorant = np.array(medium.plugin.get_majorant(mi.MediumInteraction3f())).max()
    assert majorant >= fog_of(medium).density(z).max()


def test_up_is_the_third_axis_of_the_box(loaded):
    turned = '<transform name="to_world"><scale x="40" y="40" z="43"/><rotate x="1" angle="-90"/></transform>'
    medium = read_reference(
        loaded(fog_xml(LAMP, fog=FOG[: FOG.index("<transform")] + turned + "</volume>"))
    ).medium
    np.testing.assert_array_equal(medium.up, [0, 1, 0])
    points = np.array([[3.0, 5.0, -7.0], [3.0, 8.0, 7.0]])
    np.testing.assert_allclose(
        _extinction(medium.plugin, points), fog_of(medium).density(points[:, 1]), rtol=3e-6
    )


def test_a_dictionary_gives_the_same_medium(loaded):
    scene = loaded(fog_xml(LAMP))
    register_height_fog()
    numbers = {"sigma_1": 0.13, "z_1": 0.3, "H_1": 2.7, "sigma_2": 0.02, "z_2": 1.3, "H_2": 9.7}
    box = mi.ScalarTransform4f().translate([-20, -20, -0.5]).scale([40, 40, 43])
    medium = mi.load_dict(
        {
            "type": "heterogeneous",
            "sigma_t": {"type": "heightfog", "to_world": box} | numbers,
            "albedo": 0.5,
        }
    )
    points = np.random.default_rng(1).uniform([-50, -50, 0], [50, 50, 40], (32, 3))
    own = read_reference(scene).medium.plugin
    np.testing.assert_allclose(_extinction(medium, points), _extinction(own, points), rtol=1e-6)


@pytest.mark.claim("height-fog-refused", tolerance="by name")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'name="H_1" value="2.7"',
            'name="H_1" value="0"',
            "H_1 = 0; expected a scale height above 0",
        ),
        (
            'name="sigma_2" value="0.02"',
            'name="sigma_2" value="-0.02"',
            "sigma_2 = -0.02; expected an extinction",
        ),
        ('name="H_1" value="2.7"', 'name="H_1" value="0.001"', "nothing bounds the density"),
        ('<translate x="-20"', '<rotate x="1" angle="20"/><translate x="-20"', "tilted"),
        ('<scale x="40" y="40" z="43"/>', '<scale x="40" y="40" z="0"/>', "without a height"),
    ],
)
def test_refusals_of_the_volume(loaded, old, new, message):
    with pytest.raises(InputError, match=message):
        loaded(fog_xml(LAMP, fog=FOG.replace(old, new)))


@pytest.mark.claim("height-fog-refused", tolerance="by name")
def test_refusals_of_the_scene(loaded):
    sun = SUN.replace('z="-0.45"', 'z="0.1"')
    with pytest.raises(
        InputError, match="light 'sun' is directional and shines from the horizon or below"
    ):
        read_reference(loaded(fog_xml(sun)))
    ball = """<shape type="sphere" id="drop"><bsdf type="null"/><ref id="fog" name="exterior"/>
        <medium type="homogeneous" name="interior"/></shape>"""
    with pytest.raises(InputError, match="shape 'drop' bounds a medium in height fog"):
        read_reference(loaded(fog_xml(LAMP, ball)))
    reference = read_reference(loaded(fog_xml(SPOT)))
    with pytest.raises(InputError, match="an extinction that differs from place to place"):
        _ = reference.medium.sigma_t


def _fog(engine, **given):
    fog = fog_of_engine(engine, given)
    layers = tuple(Layer(*layer) for layer in fog.layers)
    return HeightFog(layers, clamped=fog.clamped, constant=fog.constant)


@pytest.mark.claim(
    "height-fog-engines", tolerance="1e-12 relative: the shader's own formulas in float64"
)
def test_unreals_transmittance():
    density, falloff, actor, camera, rise, length = 0.037, 0.23, 1.9, 3.1, 7.3, 41.0
    # In centimetres and powers of two, as its shader has it: F = k rise, the integral D 2^(-k
    # (z - z_0)) (1 - 2^-F)/F.
    k, exponent = falloff / 1000, falloff / 1000 * rise * 100
    at_camera = density / 1000 * 2 ** (-k * (camera - actor) * 100)
    integral = at_camera * (1 - 2**-exponent) / exponent * length * 100
    expected = 2.0**-integral
    fog = _fog("unreal", FogDensity=density, FogHeightFalloff=falloff, FogHeight=actor)
    assert math.exp(-fog.optical_depth(camera, camera + rise, length)) == pytest.approx(
        expected, rel=1e-12
    )
    # The volumetric fog: 0.5 D 2^(-k (z - z_0)) per cm, base e.
    fog = _fog(
        "unreal-volumetric",
        FogDensity=density,
        FogHeightFalloff=falloff,
        FogHeight=actor,
        ExtinctionScale=1.3,
    )
    assert fog.density(camera) == pytest.approx(0.5 * at_camera * 100 * 1.3, rel=1e-12)


@pytest.mark.claim("height-fog-engines", tolerance="1e-12 relative")
def test_hdrp_and_playcanvas():
    fog = _fog("hdrp", meanFreePath=41.0, baseHeight=2.3, maximumHeight=17.9)
    np.testing.assert_allclose(
        fog.density([-3.0, 2.3, 17.9]), np.array([1, 1, 1e-3]) / 41.0, rtol=1e-12
    )
    fog = _fog("playcanvas", density=0.07, heightBase=1.1, heightFalloff=0.31)
    assert fog.density([-4.0, 1.1, 1.1 + 1 / 0.31]) == pytest.approx(
        [0.07, 0.07, 0.07 / math.e], rel=1e-12
    )
    even = _fog("playcanvas", density=0.07, heightBase=1.1, heightFalloff=0.0)
    assert even.density([-4.0, 1.1, 900.0]) == pytest.approx([0.07] * 3, rel=1e-15)


@pytest.mark.claim("height-fog-engines", tolerance="1e-12 relative")
def test_flax_has_the_analytic_fog_of_unreal_and_half_of_it_in_volumes():
    given = {"FogDensity": 0.037, "FogHeightFalloff": 0.23, "FogHeight": 1.9}
    analytic, volumetric = _fog("flax", **given), _fog("flax-volumetric", **given)
    heights = [-2.0, 1.9, 14.3]
    assert analytic.density(heights) == pytest.approx(
        _fog("unreal", **given).density(heights), rel=1e-12
    )
    assert volumetric.density(1.9) == pytest.approx(0.024 * 0.037, rel=1e-12)
    assert volumetric.density(heights) / analytic.density(heights) == pytest.approx(
        [0.24 / math.log(2) ** 2] * 3, rel=1e-12
    )


def test_parameters_come_back():
    for engine in ENGINES:
        layers = ((0.05, 1.7, 3.9), (0.01, 4.1, 11.3))[: 2 if engine.startswith("unreal") else 1]
        found = parameters_of(
            engine, layers, clamped=engine in ("hdrp", "playcanvas"), constant=0.0
        )
        assert np.ravel(fog_of_engine(engine, found).layers) == pytest.approx(
            np.ravel(layers), rel=1e-12
        )
        assert isinstance(
            parameters_of(
                engine, layers, clamped=engine not in ("hdrp", "playcanvas"), constant=0.0
            ),
            str,
        )


def test_a_scene_in_unreals_words(variant, tmp_path):
    box = '<transform name="to_world"><scale x="9" y="9" z="90"/></transform>'

    def load(*floats, engine="unreal"):
        numbers = "".join(f'<float name="{name}" value="{value}"/>' for name, value in floats)
        fog = f'<volume type="heightfog" name="sigma_t"><string name="engine" value="{engine}"/>{numbers}{box}</volume>'
        path = tmp_path / "fog.xml"
        path.write_text(fog_xml(LAMP, fog=fog))
        return read_reference(load_scene(str(path)).scene).medium

    medium = load(("FogDensity", 0.5), ("FogHeightFalloff", 4.0), ("FogHeight", 1.5))
    assert medium.layers[0] == pytest.approx((0.0240226507, 1.5, 3.6067376), rel=1e-6)
    with pytest.raises(InputError, match="has no FogHeightFalloff"):
        load(("FogDensity", 0.5))
    with pytest.raises(InputError, match="engine = godot; expected one of unreal"):
        load(engine="godot")
    with pytest.raises(InputError, match="sigma_1"):
        load(("FogDensity", 0.5), ("FogHeightFalloff", 4.0), ("sigma_1", 1.0))
