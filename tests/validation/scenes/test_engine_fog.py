# SPDX-License-Identifier: BSD-3-Clause
"""Engines' parameters of height fog: against what their shaders compute, back again, and refusals."""

import math

import numpy as np
import pytest

from analytic.errors import InputError
from analytic.height_fog import HeightFog, Layer
from reference.scene.read import read_truth
from tests.helpers.height_fog import LAMP, fog_xml
from validation.scenes.engine_fog import ENGINES, layers_of, parameters_of
from validation.scenes.loading import load_scene


def _fog(engine, **given):
    layers, clamped = layers_of(engine, given)
    return HeightFog(tuple(Layer(*layer) for layer in layers), clamped=clamped)


@pytest.mark.claim("height-fog-engines", tolerance="1e-12 relative: the shader's own formulas in float64")
def test_unreals_transmittance():
    density, falloff, actor, camera, rise, length = 0.037, 0.23, 1.9, 3.1, 7.3, 41.0
    # In centimetres and powers of two, as its shader has it: F = k rise, the integral D 2^(-k (z - z_0)) (1 - 2^-F)/F.
    k, exponent = falloff / 1000, falloff / 1000 * rise * 100
    at_camera = density / 1000 * 2 ** (-k * (camera - actor) * 100)
    integral = at_camera * (1 - 2**-exponent) / exponent * length * 100
    expected = 2.0**-integral
    fog = _fog("unreal", FogDensity=density, FogHeightFalloff=falloff, FogHeight=actor)
    assert math.exp(-fog.optical_depth(camera, camera + rise, length)) == pytest.approx(expected, rel=1e-12)
    # The volumetric fog: 0.5 D 2^(-k (z - z_0)) per cm, base e.
    fog = _fog("unreal-volumetric", FogDensity=density, FogHeightFalloff=falloff, FogHeight=actor, ExtinctionScale=1.3)
    assert fog.density(camera) == pytest.approx(0.5 * at_camera * 100 * 1.3, rel=1e-12)


@pytest.mark.claim("height-fog-engines", tolerance="1e-12 relative")
def test_hdrp_and_playcanvas():
    fog = _fog("hdrp", meanFreePath=41.0, baseHeight=2.3, maximumHeight=17.9)
    np.testing.assert_allclose(fog.density([-3.0, 2.3, 17.9]), np.array([1, 1, 1e-3]) / 41.0, rtol=1e-12)
    fog = _fog("playcanvas", density=0.07, heightBase=1.1, heightFalloff=0.31)
    assert fog.density(1.1 + 1 / 0.31) == pytest.approx(0.07 / math.e, rel=1e-12)


def test_parameters_come_back():
    for engine in ENGINES:
        layers = ((0.05, 1.7, 3.9), (0.01, 4.1, 11.3))[: 2 if engine.startswith("unreal") else 1]
        found = parameters_of(engine, layers, clamped=engine == "hdrp", constant=0.0)
        assert np.ravel(layers_of(engine, found)[0]) == pytest.approx(np.ravel(layers), rel=1e-12)
        assert isinstance(parameters_of(engine, layers, clamped=engine != "hdrp", constant=0.0), str)


def test_a_scene_in_unreals_words(variant, tmp_path):
    box = '<transform name="to_world"><scale x="9" y="9" z="90"/></transform>'

    def load(*floats, engine="unreal"):
        numbers = "".join(f'<float name="{name}" value="{value}"/>' for name, value in floats)
        fog = f'<volume type="heightfog" name="sigma_t"><string name="engine" value="{engine}"/>{numbers}{box}</volume>'
        path = tmp_path / "fog.xml"
        path.write_text(fog_xml(LAMP, fog=fog))
        return read_truth(load_scene(str(path)).scene).medium

    medium = load(("FogDensity", 0.5), ("FogHeightFalloff", 4.0), ("FogHeight", 1.5))
    assert medium.layers[0] == pytest.approx((0.0240226507, 1.5, 3.6067376), rel=1e-6)
    with pytest.raises(InputError, match="has no FogHeightFalloff"):
        load(("FogDensity", 0.5))
    with pytest.raises(InputError, match="engine = godot; wanted one of unreal"):
        load(engine="godot")
    with pytest.raises(InputError, match="sigma_1"):
        load(("FogDensity", 0.5), ("FogHeightFalloff", 4.0), ("sigma_1", 1.0))
