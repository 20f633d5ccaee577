# SPDX-License-Identifier: BSD-3-Clause
"""Skies and area lights in height fog, density grids and bounds: estimators
that share no sample agree.
"""

import numpy as np
import pytest

from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.density_grid import ROUGH, grid_xml, volume
from tests.helpers.height_fog import fog_xml

SKY = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.2, 0.3, 0.4"/></emitter>'
PANEL = """<shape type="rectangle" id="panel">
    <transform name="to_world"><scale value="0.7"/><lookat origin="1, -1, 5" target="0, 0, 1" up="0, 1, 0"/></transform>
    <emitter type="area"><rgb name="radiance" value="11, 9, 7"/></emitter></shape>"""
BULB = """<shape type="sphere" id="bulb"><float name="radius" value="0.5"/><point name="center" x="-1" y="1.4" z="4"/>
    <emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>"""
BALL = """<shape type="sphere" id="drop"><float name="radius" value="1.7"/><bsdf type="null"/>
    <ref name="interior" id="fog"/></shape>"""
DROP = """<shape type="sphere" id="drop"><float name="radius" value="0.2"/>
    <point name="center" x="-2.3" y="0.3" z="2"/></shape>"""
BEHIND = """<emitter type="directional" id="sun"><vector name="direction" x="-0.9" y="0.1" z="-0.2"/>
    <rgb name="irradiance" value="3, 2.6, 2.1"/></emitter>"""
STONE = '<shape type="cube" id="stone"><transform name="to_world"><scale value="0.4"/></transform></shape>'


def scene_file(medium, light, path):
    if medium == "height fog":
        return fog_xml(light, size=(8, 6))
    if medium == "grid":
        return grid_xml(volume(path.with_suffix(".vol"), ROUGH), light, size=(8, 6))
    return f"""<scene version="3.0.0"><medium type="homogeneous" id="fog"><float name="sigma_t" value="0.41"/>
    <float name="albedo" value="0.83"/><phase type="hg"><float name="g" value="0.4"/></phase></medium>
    <sensor type="perspective"><float name="fov" value="61"/>
        <transform name="to_world"><lookat origin="-3.1, -2.3, 1.1" target="0.1, 0.2, 0.3" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="4"/></film></sensor>
    {light}{BALL}{STONE}</scene>"""


SAMPLED = (single_scatter_batch, 100, 5e-3)
MITSUBA = (volpath_batch, 40, 1e-2)
CASES = {
    (medium, name, light): (SAMPLED, MITSUBA) if name == "sky" and medium != "grid" else (SAMPLED,)
    for medium, name, light in (
        ("height fog", "sky", SKY),
        ("height fog", "panel", PANEL),
        ("height fog", "bulb", BULB),
        ("grid", "sky", SKY),
        ("grid", "panel", PANEL),
        ("grid", "bulb", BULB),
        ("ball", "sky", SKY),
    )
}


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.claim(
    "varying-estimators", tolerance="four standard errors, 0.5 % of the airlight at most"
)
@pytest.mark.parametrize("case", CASES, ids=lambda case: ", ".join(case[:2]))
def test_estimators_agree_where_shapes_stand_in_the_light(variant, tmp_path, case):
    """Airlight and surface of the image, in red; the errors of volpath are below 1 and 2 %."""
    medium, _, light = case
    compare(tmp_path, medium, light, CASES[case], samples=256)


@pytest.mark.claim(
    "varying-estimators", tolerance="four standard errors, 0.5 % of the image at most"
)
def test_a_panel_in_height_fog(variant, tmp_path):
    """The sampled estimator finds what the quadrature does of a light whose paths have
    optical depths of their own.
    """
    compare(tmp_path, "height fog", PANEL, ((single_scatter_batch, 12, 5e-3),), samples=128)


def test_a_grid_may_reach_beyond_all_shapes(variant, tmp_path):
    """Ways to a sun ended where Mitsuba's emitter ends them, twice the radius of all shapes away:
    about a drop on this side of a grid that is lit from behind there was too much light.
    """
    path = tmp_path / "scene.xml"
    path.write_text(
        grid_xml(volume(path.with_suffix(".vol"), ROUGH), BEHIND, size=(8, 6), shapes=DROP)
    )
    reference = read_reference(load_scene(str(path)).scene)
    known = quadrature_image(reference, checks=0).airlight.mean()
    means = [single_scatter_batch(reference, seed, 128).mean[0].mean() for seed in range(8)]
    assert np.mean(means) == pytest.approx(known, rel=0.03)  # of 0.5 % by the samples


def compare(tmp_path, medium, light, traces, *, samples):
    path = tmp_path / "scene.xml"
    path.write_text(scene_file(medium, light, path))
    reference = read_reference(load_scene(str(path)).scene)
    image = quadrature_image(reference, checks=0)
    known = image.replicate_means.mean(axis=1)[:, 0]
    of_known = image.replicate_means.std(axis=1, ddof=1)[:, 0] / np.sqrt(
        image.replicate_means.shape[1]
    )
    for trace, count, most in traces:
        means = np.array(
            [trace(reference, seed, samples).mean.mean(axis=1)[:, 0] for seed in range(count)]
        )
        error = np.hypot(of_known, means.std(axis=0, ddof=1) / np.sqrt(count))
        assert (np.abs(means.mean(axis=0) - known) < 4 * error).all(), trace.__name__
        assert (error < np.array([most, 2 * most]) * known).all(), trace.__name__
