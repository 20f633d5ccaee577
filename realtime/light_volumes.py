# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: volumetric shadows from a shadow map, without marching (Billeter, Sintorn, Assarsson 2010).

What a light reaches directly is the volume between it and the surface that its shadow map samples. A camera ray enters
and leaves that volume at crossings with its boundary; with Gamma(x) the airlight from the camera to x (the paper's eq.
1), the airlight of the ray is the signed sum of eq. 3,

    L = sum_n s_n Gamma(min(x_n, x_visible)),   s_n = +1 where it leaves the light, -1 where it enters it,

in any order. The boundary is the height field of `realtime.light_heights`. Each ray looks at the texels on its line
(`realtime.volume_walk`) that a beam of rays about it may meet (`realtime.volume_tiles`); terms are put in order and
integrated pair by pair, which keeps the digits that a difference of two Gammas loses.
"""

from realtime.geometry import clip_to_cone, ray_geometry
from realtime.light_heights import light_heights
from realtime.ray_airlight import RayAirlight
from realtime.scene import Scene
from realtime.shadow_map import cast_shadow_map, check_size
from realtime.view import View, rays_in_media
from realtime.volume_tiles import tile_leaves
from realtime.volume_walk import sum_lit_pieces


def light_volumes(view: View, *, kernel, map: int = 512):
    """Return the airlight of every ray in the light volumes [W/(m^2 sr)].

    Parameters
    ----------
    view
        The frame.
    kernel
        An airlight kernel, see `realtime.kernels`.
    map
        Resolution of the shadow maps, a power of two [texels].

    Notes
    -----
    Valid for point and spot lights and any shapes that rays can be cast against. Exact with respect to the shadow map:
    what it misses of the scene falls as the size of a texel (`validation.map_study`). Bounded media have nodes of their
    own, the kernel is not asked.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*, High Performance
    Graphics.
    """
    import drjit as dr

    total = type(view.medium.albedo)(0)
    in_media = rays_in_media(view) if view.plan.bounded else ()
    for number, light in enumerate(view.lights):
        geometry = ray_geometry(view.origin, view.direction, light, low=view.direction_low)
        airlight = RayAirlight(view, light, geometry, kernel, in_media[number] if in_media else None)
        segment = type(view.distance)(0), view.distance
        if light.kind == "spot":
            segment = clip_to_cone(geometry, light.cos_cutoff, *segment)
        if not view.plan.shadows:
            total += airlight.radiance(airlight.integral(*segment))
            continue
        heights = view.prepared[number]
        toward = light.position - view.origin
        leaves = tile_leaves(
            heights, lambda lane: view.rays(lane)[0], view.distance, light=toward, square=view.square_tiles
        )
        value, _ = sum_lit_pieces(
            heights,
            leaves,
            away=-toward,
            direction=view.direction,
            segment=segment,
            integral=airlight.integral,
            zero=dr.zeros(airlight.number, dr.width(view.distance)),
        )
        total += airlight.radiance(value)
    return total


def prepare_light_volumes(scene: Scene, *, map: int, **_):
    """Return the function that makes the height field of every light of a frame."""
    check_size(map)
    return lambda scene: tuple(light_heights(cast_shadow_map(scene.geometry, light, map)) for light in scene.lights)
