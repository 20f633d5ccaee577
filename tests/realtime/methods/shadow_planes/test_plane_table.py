# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from realtime.methods.shadow_planes.plane_entries import BINS, FIRST, GAIN_SHIFT, GAIN_ZERO, NUMBER
from realtime.methods.shadow_planes.plane_table import binned, layers_between, light_basis, shadow_planes
from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.numerics.diamond_angle import host_diamond_angle
from realtime.scene.mesh_adjacency import make_casters
from tests.helpers.casters import ALL
from tests.helpers.planes import CAMERA, LIGHT, bundles, casters_of, crossings, index_of, plane_table


def planes_of(casters, light=LIGHT, camera=CAMERA):
    from realtime.methods.shadow_planes.plane_table import _parted

    return _parted(shadow_planes(casters, silhouette(casters, light), light_basis(light, camera)))


def count_between(casters, light, camera):
    """Layers between two points, triangle by triangle: a closed component by its facing or its averted ones."""
    corner = casters.vertices[casters.triangles]
    edge, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    way = camera - light
    across = np.cross(way, other)
    scale = np.sum(edge * across, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        start = light - corner[:, 0]
        u = np.sum(start * across, axis=1) / scale
        turned = np.cross(start, edge)
        v = turned @ way / scale
        t = np.sum(other * turned, axis=1) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)
    total = 0
    for component, closed in enumerate(casters.closed):
        mine = hit & (casters.component == component)
        facing = int(np.sum(mine & (scale > 0)))
        total += max(facing, int(mine.sum()) - facing) if closed else int(mine.sum())
    return total


def test_frame_is_right_handed_with_the_camera_on_the_last_axis():
    basis = light_basis(LIGHT, CAMERA)
    axes, distance = basis.axes, basis.distance
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes @ (CAMERA - LIGHT) == pytest.approx([0, 0, distance])


def test_diamond_angle_grows_with_the_azimuth_and_stays_below_a_turn():
    phi = np.linspace(0, 2 * np.pi, 4001)[:-1]
    angle = host_diamond_angle(np.cos(phi).astype(np.float32), np.sin(phi).astype(np.float32))
    assert np.all(np.diff(angle) > 0)
    just_below = host_diamond_angle(np.array([1], np.float32), np.array([-1e-9], np.float32))
    assert angle[0] == just_below[0] == 0
    assert host_diamond_angle(np.zeros(1, np.float32), np.zeros(1, np.float32))[0] == 0
    assert angle.max() < 4


@pytest.mark.parametrize("name", ["torus", "open grid", "Moebius strip", "boxes sharing an edge"])
def test_two_forms_of_a_crossing(variant, name):
    """D/x from A and B, P and Q against the solution for the point."""
    casters = casters_of(name)
    planes = planes_of(casters)
    distance = light_basis(LIGHT, CAMERA).distance
    ways = bundles(640, spread=0.1)
    azimuth = host_diamond_angle(*ways[:, :2].astype(np.float32).T)[:, None]
    quotient = ways[:, :2] @ planes.lines[:, :2].T - ways[:, 2:]
    crossed = (azimuth >= planes.first) & (azimuth < planes.last) & (quotient > 0)
    crossed &= quotient < distance * (ways[:, :2] @ planes.lines[:, 2:].T)
    x, _ = crossings(index_of(casters, precision="double"), ways)
    assert np.array_equal(np.isfinite(x), crossed)
    assert crossed.sum() > 100
    assert (distance / quotient)[crossed] == pytest.approx(x[crossed], rel=1e-9)


@pytest.mark.parametrize("name", ALL)
def test_bins_hold_what_a_ray_of_their_azimuth_crosses(name):
    planes = planes_of(casters_of(name))
    start, entries = binned(planes)
    for azimuth in np.random.default_rng(2).uniform(0, 4, 60).astype(np.float32):
        wanted = np.flatnonzero((planes.first <= azimuth) & (azimuth < planes.last))
        for turn in (0, BINS):
            place = int(azimuth * BINS / 4) + turn
            listed = entries[start[place] : start[place + 1]] & NUMBER
            assert set(wanted.tolist()) <= set(listed.tolist())
    gains = (entries >> GAIN_SHIFT & 63).astype(int) - GAIN_ZERO
    assert np.array_equal(gains, planes.gain[entries & NUMBER])
    firsts, count = entries[: len(entries) // 2] & FIRST, len(planes.gain)
    assert np.array_equal(np.sort(entries[: len(entries) // 2][firsts != 0] & NUMBER), np.arange(count))


@pytest.mark.claim("no-ray-slips-through")
@pytest.mark.parametrize("name", ALL)
def test_every_azimuth_gains_as_much_as_it_loses_but_for_the_layers_on_the_axis(name):
    """Along any half plane the layers begin with those between light and camera and end with those behind the light."""
    casters = casters_of(name)
    planes = planes_of(casters)
    azimuth = np.random.default_rng(4).uniform(0, 4, 200).astype(np.float32)[:, None]
    gained = np.sum(planes.gain * ((planes.first <= azimuth) & (azimuth < planes.last)), axis=1)
    assert len(set(gained.tolist())) == 1


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), components=st.integers(1, 4))
def test_layers_between_light_and_camera(seed, components):
    rng = np.random.default_rng(seed)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    meshes = [
        ("closed", rng.normal(size=(4, 3)), faces if rng.random() < 0.5 else faces[:, ::-1]) for _ in range(components)
    ]
    meshes.append(("open", rng.normal(size=(9, 3)), np.arange(9).reshape(3, 3)))
    casters = make_casters(meshes)
    used = np.ones(len(casters.closed), dtype=bool)
    for _ in range(4):
        light, camera = rng.normal(size=(2, 3)) * rng.choice([0.3, 1.0, 3.0], (2, 1))
        basis = light_basis(light, camera)
        assert layers_between(casters, light, basis, used=used) == count_between(casters, light, camera)
        assert layers_between(casters, light, basis, used=~used) == 0


@pytest.mark.claim("no-ray-slips-through")
def test_axis_through_edges_and_vertices_counts_each_layer_once():
    """The axis runs through edges and vertices of a grid: of the triangles there one counts."""
    from validation.scenes.parts import grid

    casters = make_casters([("grid", *grid((-1, -1, 0), (2, 0, 0), (0, 2, 0), (4, 4)))])
    used = np.ones(1, dtype=bool)
    for x, y in ((0, 0), (0.5, 0.5), (0.25, 0), (0, 0.25), (0.25, 0.25), (0.1, 0.3)):
        light, camera = np.array([x, y, 1.0]), np.array([x, y, -1.0])
        assert layers_between(casters, light, light_basis(light, camera), used=used) == 1


def test_index_has_what_the_planes_have(variant):
    casters = casters_of("torus")
    index, planes = index_of(casters, precision="double"), planes_of(casters)
    ends, first, last, gain = plane_table(index)
    assert np.array_equal(ends.reshape(-1, 6), planes.ends)
    assert np.array_equal(first, planes.first)
    assert np.array_equal(last, planes.last)
    assert np.array_equal(gain, planes.gain)
    assert np.all(last > first)


def test_no_casters_have_an_empty_index(variant):
    index = index_of(make_casters([]))
    assert np.array(index.layers).item() == 0
    assert not np.array(index.start).any()
