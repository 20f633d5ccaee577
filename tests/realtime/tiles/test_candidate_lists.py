# SPDX-License-Identifier: BSD-3-Clause
"""Lists hold every candidate whatever their room; one without room gives way to a cover of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.helpers.planes import bundles, casters_of, crossings, index_of

BOXES, LONGEST = 20, 12


@pytest.mark.claim("lists-in-any-room")
@settings(deadline=None, max_examples=50)
@given(
    length=arrays(np.uint32, BOXES, elements=st.integers(0, LONGEST)),
    stays=arrays(np.bool_, (BOXES, LONGEST)),
    room=st.integers(1, LONGEST),
)
def test_what_stays_is_counted_and_written_as_far_as_there_is_room(variant, length, stays, room):
    import drjit as dr
    import mitsuba as mi

    from realtime.tiles.candidate_lists import over_lists

    box = dr.arange(mi.UInt32, BOXES)
    target = dr.full(mi.UInt32, 99, BOXES * LONGEST)
    flags = mi.Bool(stays.ravel())
    dr.eval(target, flags)
    opaque = dr.opaque(mi.UInt32, room)

    def look(k, drawn):
        hit = dr.gather(mi.Bool, flags, box * LONGEST + k)
        dr.scatter(target, k, box * LONGEST + drawn, hit & (drawn < opaque))
        return drawn + dr.select(hit, mi.UInt32(1), 0)

    drawn = over_lists(mi.UInt32(length), look, dr.zeros(mi.UInt32, BOXES))
    dr.eval(drawn, target)
    written = np.array(target).reshape(BOXES, LONGEST)
    for k in range(BOXES):
        wanted = np.flatnonzero(stays[k, : length[k]])
        assert np.array(drawn)[k] == len(wanted)
        np.testing.assert_array_equal(written[k, : min(room, len(wanted))], wanted[:room])
        assert np.all(written[k, min(room, len(wanted)) :] == 99)


@pytest.fixture(scope="module")
def planes(variant):
    """Shadow planes, the boxes of tiles, and by tile the planes that its rays cross."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.shadow_planes.tile_boxes import tile_boxes

    index, ways = index_of(casters_of("torus", "open cylinder")), bundles(640, spread=0.05)
    parts = [mi.Float(np.ascontiguousarray(part)) for part in ways.T]
    box = tile_boxes(
        index,
        lambda lane: tuple(dr.gather(mi.Float, part, lane) for part in parts),
        dr.full(mi.Float, dr.inf, len(ways)),
        square=False,
    )
    dr.eval(box)
    crossed = np.isfinite(crossings(index, ways)[0])
    return index, box, [set(np.flatnonzero(tile.any(axis=0)).tolist()) for tile in np.split(crossed, len(ways) // 16)]


def texels_of(leaves, faces, size, side):
    """Return by tile and face the texels that its list holds."""
    from realtime.methods.light_volumes.cube_faces import FACE_BITS, NO_FACE
    from realtime.methods.light_volumes.tile_lists import LARGER, LIT

    entries, masks, first, last, order = (
        np.array(part) for part in (leaves.entries, leaves.texels, leaves.first, leaves.last, leaves.faces)
    )
    tiles, bits = [], np.arange(16)
    for tile, to_come in enumerate(order):
        while (face := int(to_come) & NO_FACE) != NO_FACE:
            image = np.zeros((size, size), dtype=bool)
            start = first[tile * faces + face]
            for place in range(start & (LIT - 1), last[tile * faces + face]):
                level, i, j = entries[place] >> 26, entries[place] & 0x1FFF, (entries[place] >> 13) & 0x1FFF
                width = size >> level
                here = image[j * width : (j + 1) * width, i * width : (i + 1) * width]
                here |= True if start & LARGER else ((masks[place] >> bits) & 1).astype(bool).reshape(side, side)
            tiles.append(((tile, face), image))
            to_come >>= FACE_BITS
    return dict(tiles)


@pytest.mark.claim("lists-in-any-room")
def test_lists_of_nodes_cover_what_is_looked_at_in_any_room(variant, monkeypatch):
    """Their cover is of larger nodes."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.light_volumes import tile_lists
    from realtime.scene.camera import ray_directions, tiled_pixels
    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.inverse_depth_field import LEAF, inverse_depth_field
    from realtime.shadow_maps.shadow_map import cast_shadow_map
    from tests.helpers.light_frames import loaded_scene

    scene = read_scene(loaded_scene("fence"))
    light, camera, size = scene.lights[0], scene.camera, 64
    heights = inverse_depth_field(cast_shadow_map(scene.geometry, light, size))
    pixel = mi.UInt32(tiled_pixels(camera.width, camera.height))
    distance = dr.full(mi.Float, 4.3, len(pixel))

    def covered(tile_room, block_room):
        monkeypatch.setattr(tile_lists, "_TILE_ROOM", tile_room)
        monkeypatch.setattr(tile_lists, "_BLOCK_ROOM", block_room)
        leaves = tile_lists.tile_leaves(
            heights,
            lambda lane: ray_directions(camera, dr.gather(mi.UInt32, pixel, lane))[0],
            distance,
            light=light.position - camera.origin,
            square=True,
        )
        return texels_of(leaves, heights.faces, size, LEAF)

    wanted = covered(4096, 4096)
    assert sum(image.sum() for image in wanted.values()) > 100
    for rooms in ((6, 1), (9, 4096), (40, 5)):
        held = covered(*rooms)
        assert held.keys() == wanted.keys()
        assert all(np.all(held[key] | ~wanted[key]) for key in wanted), rooms
        assert sum(image.sum() for image in held.values()) > sum(image.sum() for image in wanted.values())
