# SPDX-License-Identifier: BSD-3-Clause
"""Height fog as a grid: exact optical depths between its nodes, and Mitsuba reads the same density from the file."""

import mitsuba as mi
import numpy as np
import pytest

import airlight
from reference.quadrature.height_fog import fog_of
from reference.scene.read import read_reference
from reports.interchange.fog_grid import fog_grid, write_fog_grid
from tests.helpers.height_fog import LAMP, fog_xml
from validation.scenes.loading import load_scene


@pytest.fixture
def medium(variant, tmp_path):
    path = tmp_path / "fog.xml"
    path.write_text(fog_xml(LAMP))
    return read_reference(load_scene(str(path)).scene).medium


@pytest.mark.claim("height-fog-grid", tolerance="1e-12 relative between nodes, u^2/8 of the whole")
def test_optical_depths_between_nodes_are_exact(medium):
    density, fog = fog_grid(medium), fog_of(medium)
    step = (medium.cap - medium.floor) / len(density)
    z = medium.floor + step * (np.arange(len(density)) + 0.5)
    cells = 0.5 * (density[1:] + density[:-1]) * step
    np.testing.assert_allclose(cells, fog.optical_depth(z[:-1], z[1:], step), rtol=1e-12)
    # The lowest half voxel is constant: it lacks u^2/8 of sigma H, u = 1/20.
    assert density.sum() * step == pytest.approx(float(fog.column(medium.floor)), rel=1 / 20**2 / 8)


def test_mitsuba_reads_the_file(medium, tmp_path):
    text = write_fog_grid(tmp_path / "fog.vol", medium)
    read = mi.load_string(text.replace("<medium ", '<medium version="3.0.0" ', 1))
    z = np.linspace(medium.floor + 1, medium.cap - 1, 57)
    interaction = mi.MediumInteraction3f()
    interaction.p = mi.Point3f(np.stack([31 - z, 3 * z, z]).astype(np.float32))
    found = np.array(read.get_scattering_coefficients(interaction)[2])[0]
    np.testing.assert_allclose(found, fog_of(medium).density(z), rtol=5e-4)


def test_describe_writes_it(variant, tmp_path):
    (tmp_path / "fog.xml").write_text(fog_xml(LAMP))
    found = airlight.describe(str(tmp_path / "fog.xml"), output=tmp_path / "fog.vol")
    assert (tmp_path / "fog.vol").exists()
    assert "gridvolume" in found.grid
    airlight.describe("smoke", output=tmp_path / "smoke.vol")
    assert mi.VolumeGrid(str(tmp_path / "smoke.vol")).max() == pytest.approx(4.7)
    with pytest.raises(airlight.InputError, match="the medium is no height fog and no grid"):
        airlight.describe("open-fog", output=tmp_path / "open.vol")
