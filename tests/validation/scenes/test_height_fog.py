# SPDX-License-Identifier: BSD-3-Clause
"""The volume `heightfog` of Mitsuba: its density, what it refuses, and that both readers see the same fog."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.quadrature.height_fog import fog_of
from reference.scene.read import read_truth
from tests.helpers.height_fog import FOG, LAMP, SPOT, SUN, fog_xml
from validation.scenes.height_fog import register_height_fog
from validation.scenes.loading import load_scene


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
    medium = read_truth(scene).medium
    z = np.linspace(-1, 44, 181)
    found = _extinction(medium.plugin, np.stack([z * 7, 300 - z, z], axis=1))
    np.testing.assert_allclose(found, fog_of(medium).density(z), rtol=3e-6)  # float32 in Mitsuba
    majorant = np.array(medium.plugin.get_majorant(mi.MediumInteraction3f())).max()
    assert majorant >= fog_of(medium).density(z).max()


def test_up_is_the_third_axis_of_the_box(loaded):
    turned = '<transform name="to_world"><scale x="40" y="40" z="43"/><rotate x="1" angle="-90"/></transform>'
    medium = read_truth(loaded(fog_xml(LAMP, fog=FOG[: FOG.index("<transform")] + turned + "</volume>"))).medium
    np.testing.assert_array_equal(medium.up, [0, 1, 0])
    points = np.array([[3.0, 5.0, -7.0], [3.0, 8.0, 7.0]])
    np.testing.assert_allclose(_extinction(medium.plugin, points), fog_of(medium).density(points[:, 1]), rtol=3e-6)


def test_a_dictionary_gives_the_same_medium(loaded):
    scene = loaded(fog_xml(LAMP))
    register_height_fog()
    numbers = {"sigma_1": 0.13, "z_1": 0.3, "H_1": 2.7, "sigma_2": 0.02, "z_2": 1.3, "H_2": 9.7}
    box = mi.ScalarTransform4f().translate([-20, -20, -0.5]).scale([40, 40, 43])
    medium = mi.load_dict(
        {"type": "heterogeneous", "sigma_t": {"type": "heightfog", "to_world": box} | numbers, "albedo": 0.5}
    )
    points = np.random.default_rng(1).uniform([-50, -50, 0], [50, 50, 40], (32, 3))
    own = read_truth(scene).medium.plugin
    np.testing.assert_allclose(_extinction(medium, points), _extinction(own, points), rtol=1e-6)


@pytest.mark.claim("height-fog-refused", tolerance="by name")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name="H_1" value="2.7"', 'name="H_1" value="0"', "H_1 = 0; wanted a scale height above 0"),
        ('name="sigma_2" value="0.02"', 'name="sigma_2" value="-0.02"', "sigma_2 = -0.02; wanted an extinction"),
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
    with pytest.raises(InputError, match="light 'sun' is directional and shines from the horizon or below"):
        read_truth(loaded(fog_xml(sun)))
    ball = """<shape type="sphere" id="drop"><bsdf type="null"/><ref id="fog" name="exterior"/>
        <medium type="homogeneous" name="interior"/></shape>"""
    with pytest.raises(InputError, match="shape 'drop' bounds a medium in height fog"):
        read_truth(loaded(fog_xml(LAMP, ball)))
    truth = read_truth(loaded(fog_xml(SPOT)))
    with pytest.raises(InputError, match="an extinction that differs from place to place"):
        _ = truth.medium.sigma_t
