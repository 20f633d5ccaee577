# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from tests.helpers.planes import CAMERA, LIGHT, bundles, casters_of, crossings, index_of, lit_lengths, rays_of

CAMERAS = {"in the light": CAMERA, "in shadow": -0.7 * LIGHT, "among the casters": np.array([0.1, -0.05, 0.31])}
NAMES = ["torus", "crossing spheres", "open cylinder", "Moebius strip", "boxes sharing an edge"]
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


def test_lists_end_soon_behind_the_last_plane_before_the_end(variant):
    """Rays read no more than twice what is at their azimuths before their ends, over all rays."""
    index = index_of(casters_of("torus", "open cylinder"), wedges=True)
    ways, end = bundles(960, spread=0.1), np.full(960, 2.1)
    lines = np.array(index.lines, dtype=np.float64).reshape(-1, 4)
    spans = np.array(index.spans, dtype=np.float64).reshape(-1, 4)
    planes = min(len(lines), len(spans))
    from realtime.numerics.diamond_angle import host_diamond_angle

    azimuth = host_diamond_angle(*ways[:, :2].astype(np.float32).T)[:, None]
    quotient = ways[:, :2] @ lines[:planes, :2].T - ways[:, 2:]
    here = (azimuth >= spans[:planes, 0]) & (azimuth < spans[:planes, 1])
    before = here & (quotient > np.array(index.distance).item() / end[:, None])
    read = sum(len(numbers) for numbers, _ in read_by_ray(index, ways, end))
    assert before.sum() <= read < 2 * before.sum()
    assert read < 0.8 * sum(len(numbers) for numbers, _ in read_by_ray(index, ways, np.full(960, np.inf)))


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


def test_planes_marked_full_are_at_all_azimuths_of_their_wedge(variant):
    from realtime.methods.shadow_planes.plane_entries import FULL, NUMBER

    index = index_of(casters_of("torus", "sphere"), wedges=True)
    start, entries = np.array(index.wedges.start), np.array(index.wedges.entries)
    scale = np.array(index.wedges.scale).item()
    spans = np.array(index.spans, dtype=np.float64).reshape(-1, 4)
    marked = 0
    for wedge in range(int(4 * scale)):
        inside = entries[start[wedge] : start[wedge + 1]]
        full = inside[(inside & FULL) != 0] & NUMBER
        assert np.all(spans[full, 0] <= wedge / scale)
        assert np.all(spans[full, 1] >= (wedge + 1) / scale)
        marked += len(full)
    assert marked > 100


@pytest.mark.parametrize(("width", "finer"), [(0.002, False), (4.0, True)])
def test_wedges_serve_where_planes_are_finer_than_tiles(variant, width, finer):
    """The same planes, seen by narrow and by wide tiles."""
    from realtime.methods.shadow_planes.plane_table import binned, light_basis, shadow_planes
    from realtime.methods.shadow_planes.silhouettes import silhouette
    from realtime.methods.shadow_planes.wedges import wedges_pay

    casters = casters_of("torus", "crossing spheres")
    basis = light_basis(LIGHT, CAMERA)
    planes = shadow_planes(casters, silhouette(casters, LIGHT), basis)
    whole = planes.first < planes.last  # none across azimuth 0
    planes = type(planes)(*(getattr(planes, name)[whole] for name in planes.__dataclass_fields__))
    azimuth = np.linspace(0, 3.9, 40)
    assert wedges_pay(*binned(planes), azimuth, np.full(40, width)) == finer


def test_a_scene_without_planes_needs_no_wedges(variant):
    from realtime.methods.shadow_planes.plane_table import index_planes
    from realtime.numerics.array_types import array_types
    from realtime.scene.mesh_adjacency import make_casters

    none = make_casters([])
    tiles = np.linspace(0, 3.9, 40), np.full(40, 0.9)
    used = np.ones(0, dtype=bool)
    index = index_planes(none, LIGHT, CAMERA, used=used, types=array_types("single"), tiles=lambda axes: tiles)
    assert index.wedges is None
