# SPDX-License-Identifier: BSD-3-Clause
"""The height field of a map has its inverse depths, their bounds, and one value where faces meet."""

import numpy as np
import pytest

from tests.helpers.scenes import spot, tiny_scene


def heights_of(size: int, kind: str):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.inverse_depth_field import inverse_depth_field
    from realtime.shadow_maps.shadow_map import cast_shadow_map

    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    shadow_map = cast_shadow_map(scene.geometry, scene.lights[0], size)
    return shadow_map, inverse_depth_field(shadow_map)


@pytest.mark.parametrize(("size", "kind", "finest"), [(16, "point", 2), (64, "spot", 4), (4, "spot", 0)])
def test_bounds_are_those_of_the_texels(variant, size, kind, finest):
    from realtime.shadow_maps.inverse_depth_field import level_start

    _, heights = heights_of(size, kind)
    texels = np.array(heights.texels).reshape(heights.faces, size, size, 4)
    bounds = np.array(heights.bounds).reshape(heights.faces, heights.nodes, 2)
    assert heights.finest == finest
    for level in range(finest + 1):
        side = 1 << level
        squares = texels.reshape(heights.faces, side, size // side, side, size // side, 4)
        nodes = bounds[:, level_start(level) : level_start(level + 1)].reshape(heights.faces, side, side, 2)
        assert np.array_equal(nodes[..., 0], squares.min(axis=(2, 4, 5)))
        assert np.array_equal(nodes[..., 1], squares.max(axis=(2, 4, 5)))


def test_faces_of_a_cube_meet_with_the_same_values(variant):
    """The mesh of the light volume has no cracks only if rays along a common edge are the same to the last bit."""
    import mitsuba as mi

    from realtime.shadow_maps.projection import cube_direction

    shadow_map, _ = heights_of(16, "point")
    distance = np.array(shadow_map.distance).reshape(6, 17, 17)
    u = np.linspace(-1, 1, 17)
    face, row, column = (index.ravel() for index in np.indices(distance.shape))
    direction = cube_direction(mi.Vector3f, mi.UInt32(face), mi.Float(u[column]), mi.Float(u[row]))
    seen: dict[tuple[float, ...], float] = {}
    for key, value in zip(map(tuple, np.array(direction).T), distance.ravel(), strict=True):
        assert seen.setdefault(key, value) == value
    assert len(seen) == 6 * 15 * 15 + 12 * 15 + 8
