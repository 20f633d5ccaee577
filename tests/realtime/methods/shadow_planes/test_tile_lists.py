# SPDX-License-Identifier: BSD-3-Clause
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
    lists, _ = drawn_lists(index, ways, np.full(960, np.inf))
    return crossings(index, ways)[0], lists


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_lists_hold_every_plane_that_a_ray_crosses(variant, name, camera):
    for spread, end in ((0.004, np.inf), (0.1, 3.1)):
        index = index_of(casters_of(name), camera=CAMERAS[camera])
        ways, ends = bundles(960, spread=spread, camera=CAMERAS[camera]), np.full(960, end)
        x, _ = crossings(index, ways)
        lists, _ = drawn_lists(index, ways, ends)
        planes_by_tile = listed_planes(lists)
        crossed = x < ends[:, None]
        for tile, (numbers, _) in enumerate(planes_by_tile):
            wanted = np.flatnonzero(crossed[16 * tile : 16 * tile + 16].any(axis=0))
            assert set(wanted.tolist()) <= set(numbers.tolist())
            assert len(set(numbers.tolist())) == len(numbers)
    assert crossed.any()


@pytest.mark.parametrize("name", NAMES)
def test_planes_marked_full_are_crossed_by_all(variant, name):
    """Unless the ray ends before."""
    x, lists = endless(name, spread=0.004)
    marked = 0
    for tile, (numbers, full) in enumerate(listed_planes(lists)):
        assert np.isfinite(x[16 * tile : 16 * tile + 16][:, numbers[full]]).all()
        marked += int(full.sum())
    assert marked > 20


@pytest.mark.parametrize("name", NAMES)
def test_lists_are_short(variant, name):
    """No more than twice what rays of a narrow tile cross, over all tiles."""
    x, lists = endless(name, spread=0.002)
    crossed = np.isfinite(x).reshape(-1, 16, x.shape[1]).any(axis=1).sum()
    assert sum(len(numbers) for numbers, _ in listed_planes(lists)) < 2 * crossed + 20


@pytest.mark.parametrize("order", ["exact", "paper"])
def test_lists_are_in_order(variant, order):
    index = index_of(casters_of("torus"))
    ways, ends = bundles(960, spread=0.01), np.full(960, np.inf)
    lists, box = drawn_lists(index, ways, ends, order=order)
    lines = np.array(index.lines, dtype=np.float64).reshape(-1, 4)
    centre = np.array(index.spans, dtype=np.float64).reshape(-1, 4)[:, 3]
    ordered, longest = np.array(lists.sorted), 0
    for tile, (numbers, _) in enumerate(listed_planes(lists)):
        if not ordered[tile]:
            continue
        w = [np.array(part)[tile] for part in (box.x, box.y, box.z)]
        key = -(lines[numbers, 0] * w[0] + lines[numbers, 1] * w[1] - w[2]) if order == "exact" else centre[numbers]
        # Quotients are float32, of terms that can cancel.
        scale = np.abs(lines[numbers, 0] * w[0]) + np.abs(lines[numbers, 1] * w[1]) + 1
        assert np.all(np.diff(key) > -1e-6 * (scale[1:] + scale[:-1]))
        longest = max(longest, len(numbers))
    assert longest > 3
    assert ordered.mean() > 0.9


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("room", [1, 3, 6])
def test_tiles_without_room_read_the_list_they_drew_on(variant, monkeypatch, room):
    """The bins or the list of their block: every plane that is crossed is still there, once."""
    import realtime.methods.shadow_planes.tile_lists as module

    monkeypatch.setattr(module, "ROOM", room)
    monkeypatch.setattr(module, "LEAST", 0)
    x, lists = endless("torus", "open cylinder", spread=0.05)
    assert 0 < np.array(lists.sorted).mean() < 0.9
    for tile, (numbers, _) in enumerate(listed_planes(lists)):
        wanted = np.flatnonzero(np.isfinite(x[16 * tile : 16 * tile + 16]).any(axis=0))
        assert set(wanted.tolist()) <= set(numbers.tolist())
        assert len(set(numbers.tolist())) == len(numbers)


def test_full_turns_are_seen(variant):
    """A tile about the axis meets planes of every azimuth."""
    light, camera = (0.13, -0.07, 3.1), (0.13, -0.07, 1.9)
    index = index_of(casters_of("sphere"), light=light, camera=camera)
    ways = np.random.default_rng(6).uniform(-0.4, 0.4, (16, 3)) + np.array([0, 0, 1])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    x, _ = crossings(index, ways)
    lists, box = drawn_lists(index, ways, np.full(16, np.inf))
    ((numbers, _),) = listed_planes(lists)
    assert np.array(box.azimuth_half).item() == 4
    assert set(np.flatnonzero(np.isfinite(x).any(axis=0)).tolist()) <= set(numbers.tolist())


def test_a_small_image_of_many_planes_has_room(variant):
    """Its few tiles see more planes each than those of a large one; all get lists of their own, in order."""
    _, lists = endless("torus", "open cylinder", "sphere", spread=0.5)
    assert np.max(np.array(lists.source.count)) > 32
    assert np.all(np.array(lists.sorted))


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
