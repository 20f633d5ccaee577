# SPDX-License-Identifier: BSD-3-Clause
"""The list of a tile holds every plane that one of its rays crosses."""

import numpy as np
import pytest

from tests.helpers.planes import CAMERA, LIGHT, bundles, casters_of, crossings, drawn_lists, index_of, listed_planes

NAMES = ["torus", "crossing spheres", "open cylinder", "Moebius strip", "mixed winding", "boxes sharing an edge"]
CAMERAS = {
    "aside": CAMERA,
    "behind the casters": 1.3 * CAMERA - 0.9 * LIGHT,
    "near the light": LIGHT - (0.02, 0.01, 0.03),
}


def endless(*names, spread):
    """Where rays without an end cross planes, and the lists of their tiles."""
    index = index_of(casters_of(*names))
    ways = bundles(960, spread=spread)
    lists = drawn_lists(index, ways, np.full(960, np.inf))
    return crossings(index, ways)[0], lists


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_lists_hold_every_plane_that_a_ray_crosses(variant, name, camera):
    for spread, end in ((0.004, np.inf), (0.1, 3.1)):
        index = index_of(casters_of(name), camera=CAMERAS[camera])
        ways, ends = bundles(960, spread=spread, camera=CAMERAS[camera]), np.full(960, end)
        x, _ = crossings(index, ways)
        lists = drawn_lists(index, ways, ends)
        planes_by_tile = listed_planes(lists)
        crossed = x < ends[:, None]
        for tile, numbers in enumerate(planes_by_tile):
            wanted = np.flatnonzero(crossed[16 * tile : 16 * tile + 16].any(axis=0))
            assert set(wanted.tolist()) <= set(numbers.tolist())
            assert len(set(numbers.tolist())) == len(numbers)
    assert crossed.any()


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("room", [1, 3, 6])
def test_tiles_without_room_read_the_list_they_drew_on(variant, monkeypatch, room):
    """The bins or the list of their block: every plane that is crossed is still there, once."""
    import realtime.methods.shadow_planes.tile_lists as module

    monkeypatch.setattr(module, "ROOM", room)
    monkeypatch.setattr(module, "LEAST", 0)
    x, lists = endless("torus", "open cylinder", spread=0.05)
    assert 0 < np.array(lists.sorted).mean() < 0.9
    for tile, numbers in enumerate(listed_planes(lists)):
        wanted = np.flatnonzero(np.isfinite(x[16 * tile : 16 * tile + 16]).any(axis=0))
        assert set(wanted.tolist()) <= set(numbers.tolist())
        assert len(set(numbers.tolist())) == len(numbers)


def test_bins_stay_in_the_index_whatever_the_azimuth(variant):
    """The azimuth about a light that is at the camera is no number: a load from bin 2^32 - 1 ended the process."""
    import mitsuba as mi

    from realtime.methods.shadow_planes.tile_boxes import Box
    from realtime.methods.shadow_planes.tile_lists import bin_source

    index = index_of(casters_of("torus"))
    azimuths = mi.Float([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.5])
    rest = dict.fromkeys(("x", "y", "z", "x_half", "y_half", "z_half", "ray_end"), mi.Float(0))
    for half in (0.1, np.nan):
        source = bin_source(index, Box(azimuth=azimuths, azimuth_half=mi.Float([half] * 6), **rest))
        assert np.all(np.array(source.first) <= len(index.entries))
