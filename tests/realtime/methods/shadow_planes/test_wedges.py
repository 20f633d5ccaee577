# SPDX-License-Identifier: BSD-3-Clause
"""The list of a wedge holds every plane that a ray in it crosses before its end."""

import numpy as np
import pytest

from tests.helpers.planes import CAMERA, LIGHT, bundles, casters_of, crossings, index_of, lit_lengths, rays_of

CAMERAS = {"in the light": CAMERA, "in shadow": -0.7 * LIGHT, "among the casters": np.array([0.1, -0.05, 0.31])}
NAMES = ["torus", "open cylinder", "Moebius strip"]
LIGHTS = {"a place": LIGHT, "at infinity": np.append(LIGHT, 0.0)}


def read_by_ray(index, ways, end):
    """The planes that each ray reads, in order, and whether each is marked as at all azimuths of its wedge."""
    from realtime.methods.shadow_planes.plane_entries import FULL, NUMBER

    source = rays_of(index, index.wedges, ways, end).source
    entries = np.array(index.wedges.entries)
    for first, count in zip(np.array(source.first), np.array(source.count)):
        read = entries[first : first + count]
        yield read & NUMBER, (read & FULL) != 0


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_a_ray_reads_every_plane_that_it_crosses_before_its_end(variant, name, camera, light):
    """Once; solving for the point says which it crosses."""
    index = index_of(casters_of(name), LIGHTS[light], CAMERAS[camera], wedges=True)
    ways = bundles(480, spread=0.1, camera=CAMERAS[camera])
    if light == "at infinity":
        # The basis is another: any directions will do.
        ways = np.random.default_rng(5).normal(size=(2400, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
    end = np.random.default_rng(3).choice([0.9, 2.7, 6.1, np.inf], len(ways))
    x = crossings_of(index, ways)
    crossed = 0
    for ray, (numbers, _) in enumerate(read_by_ray(index, ways, end)):
        wanted = np.flatnonzero(x[ray] < end[ray] * (1 - 1e-6))  # float32 knows the end to rounding
        assert set(wanted.tolist()) <= set(numbers.tolist())
        assert len(set(numbers.tolist())) == len(numbers)
        crossed += len(wanted)
    assert crossed > 50


def crossings_of(index, ways):
    """Where rays cross planes; of a light at infinity from the four numbers of each, in float64."""
    if index.w:
        return crossings(index, ways)[0]
    from realtime.numerics.diamond_angle import host_diamond_angle

    lines = np.array(index.lines, dtype=np.float64).reshape(-1, 4)
    spans = np.array(index.spans, dtype=np.float64).reshape(-1, 4)[: len(lines)]
    lines = lines[: len(spans)]
    inverse, height = ways[:, :2] @ lines[:, :2].T, ways[:, :2] @ lines[:, 2:].T
    azimuth = host_diamond_angle(*ways[:, :2].astype(np.float32).T)[:, None]
    crossed = (inverse > 0) & (height < ways[:, 2:]) & (azimuth >= spans[:, 0]) & (azimuth < spans[:, 1])
    with np.errstate(divide="ignore"):
        return np.where(crossed, 1 / inverse, np.inf)


@pytest.mark.claim("planes-are-exact", tolerance="1e-4: float32 at grazing angles")
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_lit_segments_are_those_between_the_crossings(variant, name, camera):
    """All but one ray in a thousand: one that passes a vertex or an edge within rounding may miss it or not."""
    import drjit as dr

    from realtime.methods.shadow_planes.sweep import sum_lit_intervals

    index = index_of(casters_of(name), camera=CAMERAS[camera], wedges=True)
    ways = bundles(1920, spread=0.01, camera=CAMERAS[camera])
    end = np.random.default_rng(3).choice([0.9, 2.7, 6.1, np.inf], len(ways))
    Float = type(index.distance)
    total, lit = sum_lit_intervals(
        index,
        index.wedges,
        rays_of(index, index.wedges, ways, end),
        (Float(np.zeros(len(ways))), Float(end)),
        lambda a, b: dr.exp(-a) - dr.exp(-b),
        dr.zeros(Float, len(ways)),
    )
    expected, expected_lit = lit_lengths(index, ways, end, weight=lambda x: -np.exp(-x))
    wrong = (np.abs(np.array(total, dtype=np.float64) - expected) > 1e-4) | (np.array(lit) != expected_lit)
    assert wrong.sum() <= len(wrong) // 1000
    assert expected_lit.any()
