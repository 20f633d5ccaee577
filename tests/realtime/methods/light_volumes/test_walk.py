# SPDX-License-Identifier: BSD-3-Clause
import numpy as np

from realtime.scene.camera import ray_directions, tiled_pixels
from realtime.scene.read_scene import read_scene
from tests.helpers.light_frames import differ, fence, render
from tests.helpers.scenes import tiny_scene


def test_crossings_at_one_distance_break_no_parity(variant, monkeypatch):
    """Of two crossings at the same distance one may be the last of a pass, and the other none of the next."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.light_volumes import crossings as volume_crossings

    exact = volume_crossings.distance_at
    # Crossings of the bars, a quarter of a metre apart, come to lie at the same distances, most of them twice.
    monkeypatch.setattr(volume_crossings, "distance_at", lambda ray, t: 0.5 * dr.floor(2 * exact(ray, t)))
    monkeypatch.setattr(volume_crossings, "PLACES", 64)
    scene = mi.load_dict(tiny_scene(**fence()))
    at_once = render(scene, map=256).airlight
    for places in (2, 4, 8):
        monkeypatch.setattr(volume_crossings, "PLACES", places)
        assert differ(render(scene, map=256).airlight, at_once) < 1e-6, places  # float32: the order of the sum
    assert np.any(at_once > 0)


def test_what_is_lit_across_faces_is_one_piece(variant):
    """Rays pass up to five faces of the map about a lamp in clear space, and all of it is lit."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.light_volumes.cube_faces import NO_FACE
    from realtime.methods.light_volumes.tile_lists import tile_leaves
    from realtime.methods.light_volumes.walk import sum_lit_intervals
    from realtime.shadow_maps.inverse_depth_field import inverse_depth_field
    from realtime.shadow_maps.shadow_map import cast_shadow_map
    from realtime.tiles.layout import TILE

    speck = {"type": "sphere", "center": [0.3, 0.2, -90.0], "radius": 1e-3}  # falls between the rays of the map
    scene = read_scene(mi.load_dict(tiny_scene(ball=speck, floor=None, size=(64, 48))))
    light, distance = scene.lights[0], dr.full(mi.Float, dr.inf, 64 * 48)
    pixel = mi.UInt32(tiled_pixels(64, 48))
    heights = inverse_depth_field(cast_shadow_map(scene.geometry, light, 64))
    away = scene.camera.origin - light.position

    def rays(lane):
        return ray_directions(scene.camera, dr.gather(mi.UInt32, pixel, mi.UInt32(lane)))[0]

    leaves = tile_leaves(heights, rays, distance, light=-away, square=True)
    way = {"away": away, "direction": rays(dr.arange(mi.UInt32, 64 * 48)), "segment": (mi.Float(0), distance)}
    way["tile"] = dr.arange(mi.UInt32, 64 * 48) // TILE
    pieces, lit = sum_lit_intervals(
        heights,
        leaves,
        **way,
        integral=lambda x0, x1: dr.select(x1 > x0, mi.Float(1), 0),
        zero=dr.zeros(mi.Float, 64 * 48),
    )
    # Some rays pass the faces in another order than the middle of their tile, of which this image has few.
    assert np.mean(np.array(pieces) == 1) > 0.95
    assert np.min(np.array(pieces)) == 1
    assert np.all(np.array(lit))
    assert np.mean(np.array(leaves.faces) >> 3 != NO_FACE) > 0.9  # two faces and more
