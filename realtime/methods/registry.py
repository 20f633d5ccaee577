# SPDX-License-Identifier: BSD-3-Clause
"""Real-time methods: the in-scattered radiance of every pixel of a view.

A method is a function ``method(view, *, kernel, **parameters)``, see `realtime.methods.interface.view`. `METHODS` is
the registry: add a `Method` to it and every command and report knows it. `find_method` also finds a user's own, which
is not in it.
"""

import difflib
from types import MappingProxyType

from realtime.errors import InputError
from realtime.methods.epipolar.method import min_max, prepare_min_max
from realtime.methods.interface.method import Method
from realtime.methods.light_volumes.method import (
    finds_lit_surfaces,
    light_volume_tiles,
    light_volumes,
    prepare_light_volumes,
)
from realtime.methods.ray_march import prepare_maps, ray_march
from realtime.methods.shadow_planes.method import prepare_shadow_planes, shadow_plane_tiles, shadow_planes
from realtime.methods.unshadowed import unshadowed
from realtime.methods.user_method import own_method

METHODS: dict[str, Method] = {
    "unshadowed": Method(
        "unshadowed",
        unshadowed,
        "one airlight integral a ray and light, no volumetric shadows",
        "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005",
        shadows=False,
    ),
    "ray-march": Method(
        "ray-march",
        ray_march,
        "midpoint steps with one visibility test each: the baseline to beat",
        "Billeter, Sintorn, Assarsson 2010, section 2; Kulla and Fajardo 2012 (equi-angular steps)",
        uses_kernel=False,
        prepare=prepare_maps,
        prepared_from=frozenset({"geometry", "light"}),
        casts_rays=lambda settings: settings["shadow"] == "ray",
        tiled=lambda settings: True,
        parameters=MappingProxyType(
            {"steps": 100, "spacing": "equiangular", "shadow": "ray", "map": 512, "tolerance": 0.0}
        ),
    ),
    "shadow-planes": Method(
        "shadow-planes",
        shadow_planes,
        "silhouettes extruded to planes; lit segments between their crossings",
        "Biri, Arques, Michelin 2006",
        prepare=prepare_shadow_planes,
        prepared_from=frozenset({"camera", "geometry", "light"}),
        tiles=shadow_plane_tiles,
        casts_rays=lambda settings: settings["evaluation"] == "vertex",  # to know the triangle of a surface
        provides_visibility=lambda settings: True,
        tiled=lambda settings: settings["evaluation"] == "pixel",
        parameters=MappingProxyType(
            {
                "order": "exact",
                "evaluation": "pixel",
                "sum": "segments",
                "buffer": "float",
                "white": 1.0,
                "rows": 16,
                "ambient": 0.0,
                "media": "exact",
                "cone": 0,
                "tolerance": 0.0,
            }
        ),
    ),
    "light-volumes": Method(
        "light-volumes",
        light_volumes,
        "the volume between the light and its shadow map, crossed without marching",
        "Billeter, Sintorn, Assarsson 2010",
        prepare=prepare_light_volumes,
        prepared_from=frozenset({"geometry", "light"}),
        tiles=light_volume_tiles,
        provides_visibility=finds_lit_surfaces,
        tiled=lambda settings: settings["evaluation"] == "walk",
        frozen=lambda settings: settings["evaluation"] == "walk",  # the crossings of a mesh are counted on the way
        parameters=MappingProxyType(
            {
                "map": 512,
                "evaluation": "walk",
                "tessellation": "static",
                "threshold": 1e-3,
                "surface": "map",
                "walls": "upright",
                "tolerance": 0.0,
            }
        ),
    ),
    "min-max": Method(
        "min-max",
        min_max,
        "epipolar slices with 1D min/max trees over the shadow map; airlight interpolated between samples",
        "Chen, Baran, Durand, Jarosz 2011; Yusov 2013",
        prepare=prepare_min_max,
        prepared_from=frozenset({"geometry", "light"}),
        parameters=MappingProxyType({"map": 512, "slices": 0, "samples": 0, "step": 16, "sampling": "slices"}),
    ),
}


def find_method(name: str) -> Method:
    """Return the record of a method.

    Parameters
    ----------
    name
        A name of `METHODS`, or a user's own: 'module:function', 'path/to/file.py:function'
        (`realtime.methods.user_method`).

    Raises
    ------
    InputError
        For an unknown name (the nearest is named), and for what cannot be imported or is no method.
    """
    if name in METHODS:
        return METHODS[name]
    if ":" in name:
        return own_method(name)
    close = difflib.get_close_matches(name, METHODS, n=1, cutoff=0.4)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise InputError(f"method: got {name!r}, wanted one of {', '.join(METHODS)}, or your own 'module:function'{hint}")
