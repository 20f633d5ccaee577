# SPDX-License-Identifier: BSD-3-Clause
import numpy as np

from tests.helpers.planes import casters_of, index_of


def test_square_tiles_are_bounded_by_their_corners(variant):
    """As lanes of a frame are ordered, for a wide field of view: the box of all sixteen lies within."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.shadow_planes.tile_boxes import tile_boxes
    from realtime.scene.camera import ray_directions, tiled_pixels
    from realtime.scene.read_scene import read_scene
    from tests.helpers.scenes import tiny_scene

    camera = read_scene(mi.load_dict(tiny_scene(size=(64, 48)))).camera
    pixel = mi.UInt32(tiled_pixels(64, 48))
    index = index_of(casters_of("box"))

    def rays(lane):
        way, _ = ray_directions(camera, dr.gather(mi.UInt32, pixel, mi.UInt32(lane)))
        return way.x, way.y, way.z

    distance = dr.full(mi.Float, 1.0, 64 * 48)
    few, all_rays = (tile_boxes(index, rays, distance, square=square) for square in (True, False))
    for axis in "xyz":
        half, other = (np.array(getattr(box, f"{axis}_half")) for box in (few, all_rays))
        centre, other_centre = (np.array(getattr(box, axis)) for box in (few, all_rays))
        assert np.max(np.abs(centre - other_centre) + other - half) < 2e-7  # rounding
        assert np.max(half - other) < 2e-3  # the sphere bulges by (angle)^2 / 8: 4 pixels of 0.9 degrees are 0.06
    assert len(np.array(few.x)) == 64 * 48 // 16
