# SPDX-License-Identifier: BSD-3-Clause
"""The planes of a ray are found, sorted and added up in whatever order they come."""

import itertools
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.methods.shadow_planes.plane_table as module
from airlight.errors import InputError
from airlight.realtime.methods.shadow_planes.plane_table import NUMBER, planes_of_rays
from airlight.realtime.methods.shadow_planes.sweep import sum_lit_intervals
from tests.helpers.shadow_planes import (
    CAMERA,
    LIGHT,
    bundles,
    crossings,
    lit_lengths,
    occluders_of,
    planes_of,
    rays_of,
)


def listed_planes(index, rays):
    """Return by ray the numbers of the planes of its wedge that it may cross, in order."""
    entries = np.array(index.entries)
    places = zip(np.array(rays.first), np.array(rays.count))
    return [entries[first : first + count] & NUMBER for first, count in places]


# Wedges -------------------------------------------------------------------------------------------


MESHES = [
    "torus",
    "crossing spheres",
    "open cylinder",
    "Moebius strip",
    "mixed winding",
    "boxes sharing an edge",
]
ASIDE = {
    "aside": CAMERA,
    "behind the occluders": 1.3 * CAMERA - 0.9 * LIGHT,
    "near the light": LIGHT - (0.02, 0.01, 0.03),
}


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("camera", ASIDE)
@pytest.mark.parametrize("name", MESHES)
def test_wedges_hold_every_plane_that_a_ray_crosses(variant, name, camera):
    for spread, end in ((0.004, np.inf), (0.1, 3.1)):
        planes = planes_of(occluders_of(name), camera=ASIDE[camera])
        ways = bundles(960, spread=spread, camera=ASIDE[camera])
        crossed = crossings(planes, ways)[0] < end
        listed = listed_planes(planes.index, rays_of(planes.index, ways, np.full(960, end)))
        # One ray in a thousand passes the end of an edge within rounding.
        missed = [
            set(np.flatnonzero(own).tolist()) - set(numbers.tolist())
            for own, numbers in zip(crossed, listed)
        ]
        assert sum(map(bool, missed)) <= 1
        assert all(len(set(numbers.tolist())) == len(numbers) for numbers in listed)
    assert crossed.any()


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [("NUMBER", 2, "expected up to 3 of 31"), ("GAIN_ZERO", 1, "of up to 1 layers")],
)
def test_more_planes_or_layers_than_an_entry_holds_are_refused(
    variant, monkeypatch, name, value, words
):
    """They would spill into the bits of their neighbours: shadows that nobody cast."""
    monkeypatch.setattr(module, name, value)
    with pytest.raises(InputError, match=words):
        planes_of(occluders_of("box"))


def test_wedges_stay_in_the_index_whatever_the_azimuth(variant):
    """The azimuth about a light that is at the camera is no number: a load from wedge
    2^32 - 1 ended the process.
    """
    index = planes_of(occluders_of("torus")).index
    azimuths = mi.Float([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.5])
    way = (mi.Float([0.6] * 6), mi.Float([0.0] * 6), mi.Float([0.8] * 6))
    first, count = planes_of_rays(index, azimuths, way, mi.Float([0.0] * 6))
    assert np.all(np.array(first) + np.array(count) <= len(index.entries))


# Sums over lit segments ---------------------------------------------------------------------------


@pytest.mark.claim("rays-notice-a-wrong-order", tolerance="1e-4: float32 at grazing angles")
@pytest.mark.parametrize(
    "order", ["shuffled", "backwards", "two changed", "five at a time backwards"]
)
def test_rays_notice_an_order_that_is_wrong(variant, order):
    """And find their segments with a longer queue, or by selection."""
    planes = planes_of(occluders_of("torus", "open cylinder", "crossing spheres"))
    index = planes.index
    ways = bundles(960, spread=0.01)
    entries, start = np.array(index.entries), np.array(index.start).astype(int)
    rng = np.random.default_rng(9)
    changed = 0
    for first, behind in itertools.pairwise(start):
        places, count = np.arange(first, behind), behind - first
        if order == "shuffled":
            entries[places] = entries[rng.permutation(places)]
        elif order == "backwards":
            entries[places] = entries[places[::-1]]
        elif order == "two changed":
            if count > 3:
                entries[places[[0, -1]]] = entries[places[[-1, 0]]]
        # five at a time backwards: too much for a queue of two, nothing for one of eight
        elif count > 0:
            entries[places] = entries[
                np.concatenate([places[k : k + 5][::-1] for k in range(0, count, 5)])
            ]
        changed += count > 3
    # rays read all of their wedge
    bounds = dr.full(type(index.bounds), np.inf, dr.width(index.bounds))
    expected, expected_lit = lit_lengths(
        planes, ways, np.full(len(ways), np.inf), weight=lambda x: -np.exp(-x)
    )
    changed_index = replace(index, entries=mi.UInt32(entries), bounds=bounds)
    assert changed > 20
    Float = type(index.distance)
    zero, end = dr.zeros(Float, len(ways)), dr.full(Float, np.inf, len(ways))
    rays = rays_of(changed_index, ways, np.full(len(ways), np.inf))
    total, lit = sum_lit_intervals(
        changed_index, rays, (zero, end), lambda a, b: dr.exp(-a) - dr.exp(-b), zero
    )
    # All but one ray in a thousand: one that passes a vertex or an edge within
    # rounding may miss it or not.
    assert (
        np.mean((np.abs(np.array(total) - expected) > 1e-4) | (np.array(lit) != expected_lit))
        <= 1e-3
    )
