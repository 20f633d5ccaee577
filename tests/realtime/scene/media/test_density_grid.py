# SPDX-License-Identifier: BSD-3-Clause
"""A density grid around the camera on the device: methods against the reference, and refusals."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.numerics.array_types import aligned_array, array_types
from airlight.realtime.scene.density import DensityGrid, density_on_device
from airlight.realtime.scene.media.density_grid import GridMedium
from airlight.realtime.scene.phase import Isotropic
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.density_grid import INSIDE, ROUGH, SPOT, grid_xml, volume
from tests.helpers.frames import relative_rmse
from tests.helpers.height_fog import LAMP, SUN


@pytest.fixture
def scene(variant, tmp_path):
    def load(*lights, **how):
        path = tmp_path / "grid.xml"
        path.write_text(grid_xml(volume(tmp_path / "smoke.vol", ROUGH, **how), *lights))
        return load_scene(str(path)).scene

    return load


@pytest.mark.claim(
    "density-grid-methods", tolerance="2e-5 of the largest value: float32 and six digits of the box"
)
@pytest.mark.parametrize(
    "turn",
    [
        '<scale x="-1"/>',
        '<scale y="-1" z="-1"/>',
        '<rotate x="1" angle="90"/>',
        '<rotate y="1" angle="90"/><scale z="-1"/><rotate z="1" angle="90"/>',
    ],
)
def test_a_mirrored_grid_and_one_turned_by_right_angles_lie_as_mitsuba_lays_them(scene, turn):
    """Exporters of programs with y upwards turn the unit cube, and some mirror it."""
    loaded = scene(LAMP, turn=turn)
    reference, methods = read_reference(loaded).medium, read_scene(loaded, "double").medium
    place = np.random.default_rng(7).uniform(reference.low, reference.high, (200, 3))
    interaction = dr.zeros(mi.MediumInteraction3f, len(place))
    interaction.p = mi.Point3f(place.T)
    wanted = np.array(reference.plugin.get_scattering_coefficients(interaction)[2])[0]
    found = np.array(methods.density.at(mi.Point3d(place.T), mi.UInt32(0))) * np.array(
        methods.largest
    )
    assert np.ptp(wanted) > 0.5
    for each in (reference.extinction(place), found):
        np.testing.assert_allclose(each, wanted, rtol=0, atol=2e-5 * wanted.max())
    np.testing.assert_allclose(np.ravel(methods.low), reference.low, atol=1e-5)
    np.testing.assert_allclose(np.ravel(methods.high), reference.high, atol=1e-5)


@pytest.mark.claim(
    "density-grid-methods", tolerance="5e-3 of 400 steps: they know no faces and edges"
)
@pytest.mark.parametrize("light", [LAMP, INSIDE, SPOT, SUN])
def test_a_ray_march_goes_to_the_reference(scene, light):
    loaded = scene(light)
    reference = quadrature_image(read_reference(loaded), checks=0)
    errors = []
    for precision, steps in (("single", 400), ("double", 100), ("double", 400)):
        frame = render_frame(
            frame_renderer(read_scene(loaded, precision), METHODS["ray-march"], steps=steps)
        )
        errors.append(relative_rmse(frame.airlight, reference.airlight))
        # Depths are exact by cells: only rounding is left of a surface.
        np.testing.assert_allclose(
            frame.surface, reference.surface, rtol=1e-4, atol=1e-4 * reference.surface.max()
        )
    assert max(errors[::2]) < 5e-3
    assert errors[2] < 0.5 * errors[1]


def test_depths_are_exact_in_voxels_of_any_size(variant):
    """A metre of a ray was a difference of two places in the grid, which rounding took away."""
    types, random = array_types("single"), np.random.default_rng(3)
    values = random.random((5, 6, 7), dtype=np.float32)
    aims = random.uniform(0, 1, (100, 3)) * (7, 6, 5) - (-2.0, 3.1, 2.6)
    aims = (aims / np.linalg.norm(aims, axis=1)[:, None]).T

    def depths(voxel):
        sides = voxel * np.array([7.0, 6.0, 5.0])
        to_grid = np.column_stack([np.diag(1 / sides), np.zeros(3)])
        density = density_on_device([DensityGrid(values, 1 / voxel, to_grid)], types)
        ends = types.vector(0, 0, 0), types.vector(*sides.tolist())
        largest = dr.opaque(types.scalar, 1 / voxel)
        medium = GridMedium(density, largest, *ends, types.color(1), Isotropic())
        origin = types.vector(-2 * voxel, 3.1 * voxel, 2.6 * voxel)
        ways = types.vector(*(aligned_array(types.scalar, column) for column in aims))
        end = dr.full(types.scalar, np.inf, aims.shape[1])
        return np.array(medium.optical_depth(medium.rays(origin, ways), 0, end)[0])

    of_centimetres = depths(2.0**-6)
    assert of_centimetres.min() > 0.05
    np.testing.assert_allclose(depths(2.0**24), of_centimetres, rtol=1e-5)


def test_depths_of_steps_add_up_to_the_depth_from_the_camera(scene, monkeypatch):
    read = read_scene(scene(INSIDE))
    marched = []
    for sums in (True, False):  # else each step walks all cells from the camera on
        monkeypatch.setattr(GridMedium, "sums_depth", sums)
        marched.append(render_frame(frame_renderer(read, METHODS["ray-march"], steps=30)).airlight)
    np.testing.assert_allclose(*marched, rtol=2e-5)


@pytest.mark.claim(
    "density-grid-methods", tolerance="5 %: froxels of 6 cm in a box that ends within them"
)
def test_froxels_go_to_the_reference(scene):
    loaded = scene(SUN)
    reference = quadrature_image(read_reference(loaded), checks=0)
    how = {"slices": 256, "shadow": "ray"}
    frame = render_frame(frame_renderer(read_scene(loaded), METHODS["froxel-fog"], **how))
    assert relative_rmse(frame.airlight, reference.airlight) < 0.05


@pytest.mark.claim(
    "density-grid-methods", tolerance="3 % of 200 steps in a third of the box: edges of a grille"
)
def test_the_built_in_scene(variant):
    loaded = load_scene("smoke", (24, 18)).scene
    reference = quadrature_image(read_reference(loaded), checks=8)
    assert reference.left == 0
    assert reference.airlight_error.max() < 1e-4 * reference.airlight.mean()
    frame = render_frame(frame_renderer(read_scene(loaded), METHODS["ray-march"], steps=200))
    assert relative_rmse(frame.airlight, reference.airlight) < 0.03


@pytest.mark.claim("density-grid-refused", tolerance="none: an error and its words")
def test_methods_of_lit_segments_and_turned_boxes_are_refused(scene):
    read = read_scene(scene(LAMP))
    refused = [name for name in FOG_METHODS if METHODS[name]().uses_kernel]
    assert {"shadow-planes", "light-volumes", "unshadowed"} <= set(refused)
    for name in refused:
        with pytest.raises(
            InputError,
            match=r"the medium is a density grid.*use froxel-fog, soft-shafts, or ray-march",
        ):
            frame_renderer(read, METHODS[name], kernel=KERNELS["exact"])
    with pytest.raises(InputError, match="whose box is turned"):
        read_scene(scene(LAMP, turn='<rotate z="1" angle="30"/>'))
