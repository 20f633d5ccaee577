# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from realtime.errors import InputError
from tests.helpers.scenes import spot, tiny_scene

KINDS = ["point", "spot"]
TESSELLATIONS = ["static", "adaptive"]


def map_of(kind: str, size: int, **changes):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import cast_shadow_map

    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}), **changes)))
    return cast_shadow_map(scene.geometry, scene.lights[0], size), scene.lights[0]


def assert_closed(mesh):
    """Every edge has two triangles of opposite direction, and the surface is one sphere: no vertex twice."""
    ends = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    count = len(mesh.vertices)
    keys = ends[:, 0] * count + ends[:, 1]
    assert len(np.unique(keys)) == len(keys)
    assert np.array_equal(np.sort(keys), np.sort(ends[:, 1] * count + ends[:, 0]))
    assert np.array_equal(np.unique(mesh.triangles), np.arange(count))
    assert count - len(keys) // 2 + len(mesh.triangles) == 2  # Euler


def signed_crossings(mesh, start, ends):
    """Return the sum of signs of the crossings of segments, +1 along the normal, by determinants alone."""
    total = np.zeros(len(ends), int)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    p = np.append(start, 1.0)

    def plane(x, y, z):
        """Return the plane w with w . q = det(x, y, z, q)."""
        rows = np.stack(np.broadcast_arrays(x, y, z), axis=1)
        minors = [np.linalg.det(np.delete(rows, k, axis=2)) * (-1) ** (k + 1) for k in range(4)]
        return np.stack(minors, axis=1)

    # With a at the origin of affine space det(a, b, c, q) = -(b x c) . q: negative on the side of the normal.
    triangle, sides = plane(a, b, c), [plane(p, *pair) for pair in ((a, b), (b, c), (c, a))]
    from_start = triangle @ p
    for k, end in enumerate(ends):
        q = np.append(end, 1.0)
        to_end = triangle @ q
        inside = np.stack([side @ q for side in sides])
        hit = (from_start * to_end < 0) & (np.all(inside > 0, axis=0) | np.all(inside < 0, axis=0))
        total[k] = np.sum(np.sign(from_start - to_end)[hit])
    return total


def heights_above(shadow_map, light, points):
    """Return s of points and the height field there, in float64, from the distances of the map; outside s = -1."""
    size = shadow_map.size
    distance = np.array(shadow_map.distance, dtype=float).reshape(shadow_map.faces, size + 1, size + 1)
    d = points - np.array(light.position, dtype=float).ravel()
    if shadow_map.projection.basis:
        across, up, axis = (np.array(vector, dtype=float).ravel() for vector in shadow_map.projection.basis)
        a, b, depth = np.linalg.solve(np.stack([across, up, axis], axis=1), d.T)
        face = np.zeros(len(d), int)
        tangent = float(np.linalg.norm(across))
    else:
        axis = np.argmax(abs(d), axis=1)
        a, b, depth = (d[np.arange(len(d)), (axis + k) % 3] for k in (1, 2, 0))
        face = 2 * axis + (depth < 0)
        depth = abs(depth)
        tangent = 1.0
    u, v = a / depth, b / depth
    inside = (depth > 0) & (abs(u) <= 1) & (abs(v) <= 1)
    x, y = (np.where(inside, (coordinate + 1) * size / 2, 0) for coordinate in (u, v))
    column, row = (np.minimum(coordinate.astype(int), size - 1) for coordinate in (x, y))
    grid = np.linspace(-1, 1, size + 1)
    length = np.sqrt(1 + tangent**2 * (grid[None, :] ** 2 + grid[:, None] ** 2))
    s00, s10, s01, s11 = (
        (length / distance[face])[np.arange(len(d)), row + j, column + i] for j, i in ((0, 0), (0, 1), (1, 0), (1, 1))
    )
    x, y = x - column, y - row
    lower, upper = s00 + x * (s10 - s00) + y * (s11 - s10), s00 + y * (s01 - s00) + x * (s11 - s01)
    return np.where(inside, 1 / np.where(inside, depth, 1), -1), np.where(x >= y, lower, upper)


@pytest.mark.claim("closed-mesh")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [4, 32])
@pytest.mark.parametrize("tessellation", TESSELLATIONS)
def test_mesh_is_closed(variant, kind, size, tessellation):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    shadow_map, light = map_of(kind, size)
    mesh = volume_mesh(shadow_map, light, tessellation=tessellation)
    assert_closed(mesh)
    assert np.all(mesh.vertices[:, 3] >= 0)
    if tessellation == "static":
        cells = shadow_map.faces * size**2
        assert len(mesh.triangles) == 2 * cells + (4 * size if kind == "spot" else 0)
        assert len(mesh.vertices) == ((size + 1) ** 2 + 1 if kind == "spot" else cells + 2)
    elif size == 32:
        assert len(mesh.triangles) < shadow_map.faces * size**2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tessellation", TESSELLATIONS)
@pytest.mark.parametrize("floor", [True, False], ids=["floor", "open"])
def test_parity_tells_lit_from_unlit(variant, kind, tessellation, floor):
    """Without a floor most vertices are at infinity."""
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    threshold = 1e-2
    shadow_map, light = map_of(kind, 16, **({} if floor else {"floor": None}))
    mesh = volume_mesh(shadow_map, light, tessellation=tessellation, threshold=threshold)
    place = np.array(light.position, dtype=float).ravel()
    rng = np.random.default_rng(8)
    points = rng.uniform((-2, -2, -1.5), (2, 2, 3), (1500, 3))
    s, height = heights_above(shadow_map, light, points)
    # float32 heights against float64 ones; errors of an adaptive mesh are a small multiple of the threshold.
    margin = 1e-5 if tessellation == "static" else 4 * threshold
    clear = abs(s - height) > margin * height
    lit = s > height
    assert np.mean(clear) > 0.9
    assert min(np.mean(lit), np.mean(~lit)) > 0.05
    inner = 2e-4 * np.array([0.31, 0.23, -0.83])  # towards the floor, inside the cone of the spot
    if kind == "spot":
        inner += 1e-3 * np.array(light.axis, dtype=float).ravel()
    layers = signed_crossings(mesh, place + inner, points[clear])
    assert np.array_equal(layers, np.where(lit[clear], 0, 1))


@pytest.mark.parametrize("kind", KINDS)
def test_a_fine_threshold_gives_the_same_surface(variant, kind):
    from realtime.methods.light_volumes.published.mesh import _heights
    from realtime.methods.light_volumes.published.tessellation import divide, edges
    from tests.helpers.tessellated_heights import tessellated_heights

    shadow_map, _ = map_of(kind, 64)
    height = _heights(shadow_map)
    tessellated = tessellated_heights(height, divide(edges(height, 1e-6)))
    # Errors of the levels add up, and the heights carry the rounding errors of float32 distances.
    assert tessellated == pytest.approx(height.astype(float), rel=1e-5)


@pytest.mark.parametrize(("kind", "triangles"), [("point", 12), ("spot", 2 + 4)])
def test_a_map_that_sees_nothing(variant, kind, triangles):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    shadow_map, light = map_of(kind, 8, floor=None, ball=None)
    mesh = volume_mesh(shadow_map, light, tessellation="adaptive")
    assert len(mesh.triangles) == triangles
    assert_closed(mesh)
    assert np.sum(mesh.vertices[:, 3] > 0) == (1 if kind == "spot" else 0)


def random_cube(size: int, seed: int):
    """Return a map of six faces with random edges everywhere, also across the borders of faces."""
    import mitsuba as mi

    from realtime.methods.light_volumes.published.mesh import _welds
    from realtime.shadow_maps.projection import Projection
    from realtime.shadow_maps.shadow_map import ShadowMap

    rng = np.random.default_rng(seed)
    side = size + 1
    coarse = np.kron(rng.uniform(1, 3, (6, 4, 4)), np.ones((size // 4, size // 4)))
    distance = np.pad(coarse, ((0, 0), (0, 1), (0, 1)), "edge")
    distance = np.where(rng.random((6, side, side)) < 3 / size**2, 0.5, distance).ravel()
    twin, original = _welds(size)
    distance[twin] = distance[original]
    return ShadowMap(size, mi.Float(distance), Projection(None))


@pytest.mark.claim("closed-mesh")
@pytest.mark.parametrize("seed", range(6))
def test_faces_are_welded_without_cracks_whatever_the_levels(variant, seed):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    _, light = map_of("point", 4)
    shadow_map = random_cube(64, seed)
    mesh = volume_mesh(shadow_map, light, tessellation="adaptive", threshold=0.2)
    assert_closed(mesh)
    static = volume_mesh(shadow_map, light)
    assert_closed(static)
    assert len(mesh.triangles) < 0.9 * len(static.triangles)
    # The vertices of faces of different handedness still look outwards.
    place = np.array(light.position, dtype=float).ravel()
    points = mesh.vertices[:, :3] / mesh.vertices[:, 3:] - place
    a, b, c = (points[mesh.triangles[:, k]] for k in range(3))
    assert np.all(np.linalg.det(np.stack([a, b, c], axis=1)) > 0)


def test_stages_are_timed(variant):
    from realtime.methods.light_volumes.published.mesh import tessellation_stages, volume_mesh

    shadow_map, light = map_of("point", 16)
    times, mesh = tessellation_stages(shadow_map, light)
    assert list(times) == ["laplacian", "edge map", "tessellate", "vertices"]
    assert all(time > 0 for time in times.values())
    same = volume_mesh(shadow_map, light, tessellation="adaptive")
    assert np.array_equal(mesh.vertices, same.vertices)
    assert np.array_equal(mesh.triangles, same.triangles)


@pytest.mark.claim("memory-before-it-is-taken")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tessellation", TESSELLATIONS)
def test_memory_is_told_before(variant, kind, tessellation):
    import tracemalloc

    from realtime.methods.light_volumes.published.mesh import memory_needed, volume_mesh

    shadow_map, light = map_of(kind, 256)
    volume_mesh(shadow_map, light, tessellation=tessellation)  # kernels compiled
    tracemalloc.start()
    volume_mesh(shadow_map, light, tessellation=tessellation)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    told = memory_needed(shadow_map.faces, 256)
    # Batches of 2^16 vertices and the like take some megabytes whatever the size.
    assert peak < 1.05 * told + 6e6
    assert tessellation == "adaptive" or peak > 0.7 * told


def test_bad_input(variant):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    shadow_map, light = map_of("point", 8)
    with pytest.raises(InputError, match="tessellation: got 'fine', wanted static or adaptive"):
        volume_mesh(shadow_map, light, tessellation="fine")
    with pytest.raises(InputError, match="threshold: got 0"):
        volume_mesh(shadow_map, light, tessellation="adaptive", threshold=0)
    shadow_map.distance[5] = 0
    with pytest.raises(InputError, match="light: a surface touches it"):
        volume_mesh(shadow_map, light)
