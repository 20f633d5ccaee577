# SPDX-License-Identifier: BSD-3-Clause
"""Real-time methods: the layers of every pixel of a view.

A method is a record, `realtime.methods.interface.method.Method`. `METHODS` is the registry: add a record to it and
every command and report knows it. `find_method` also finds a user's own, which is not in it.
"""

from realtime.area_lights.points import LightPoints
from realtime.clouds.order_layers import OPACITY, ORDER_LAYERS
from realtime.errors import InputError
from realtime.methods.cloud_collectors import (
    CollectorParameters,
    carries,
    cloud_collectors,
    collector_errors,
    prepare_collectors,
)
from realtime.methods.cloud_octaves import CloudOctavesParameters, cloud_octaves, prepare_cloud_octaves
from realtime.methods.epipolar.method import MinMaxParameters, min_max, prepare_min_max
from realtime.methods.froxel_fog.method import (
    FroxelFogParameters,
    froxel_errors,
    froxel_fog,
    hands_on,
    prepare_froxel_fog,
)
from realtime.methods.interface.method import Method, always, never
from realtime.methods.light_volumes.method import (
    LightVolumeParameters,
    finds_lit_surfaces,
    light_volumes,
    prepare_light_volumes,
)
from realtime.methods.ray_march import RayMarchParameters, marching_errors, prepare_maps, ray_march
from realtime.methods.shadow_planes.method import (
    ShadowPlaneParameters,
    prepare_shadow_planes,
    shadow_planes,
)
from realtime.methods.soft_shafts.method import prepare_soft_shafts, shares_by_source, soft_shafts
from realtime.methods.soft_shafts.parameters import SoftShaftsParameters, soft_shaft_errors
from realtime.methods.unshadowed import render_unshadowed
from realtime.methods.user_method import own_method
from realtime.parameters import nearest

METHODS: dict[str, Method] = {
    "unshadowed": Method(
        "unshadowed",
        render_unshadowed,
        "one airlight integral a ray and light, no volumetric shadows",
        "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005",
        shadows=False,
        error_causes=lambda parameters, size: (("shadows", None),),
    ),
    "ray-march": Method(
        "ray-march",
        ray_march,
        "midpoint steps with one visibility test each: the baseline to beat",
        "Billeter, Sintorn, Assarsson 2010, section 2; Kulla and Fajardo 2012 (equi-angular steps)",
        uses_kernel=lambda parameters: parameters.sum == "transitions",
        prepare=prepare_maps,
        prepared_from=frozenset({"geometry", "light"}),
        casts_rays=lambda parameters: parameters.shadow == "ray",
        by_rays=always,
        parameters=RayMarchParameters,
        error_causes=marching_errors,
    ),
    "shadow-planes": Method(
        "shadow-planes",
        shadow_planes,
        "silhouettes extruded to planes; lit segments between their crossings",
        "Biri, Arques, Michelin 2006",
        prepare=prepare_shadow_planes,
        prepared_from=frozenset({"camera", "geometry", "light"}),
        casts_rays=lambda parameters: parameters.evaluation == "vertex",  # to know the triangle of a surface
        provides_visibility=always,
        by_rays=lambda parameters: parameters.evaluation == "pixel",
        # What is no light's own, and a buffer that rounds, hold for the sum of all lights.
        lights_at_once=lambda parameters: parameters.buffer == "8bit" or parameters.ambient > 0,
        parameters=ShadowPlaneParameters,
        error_causes=lambda parameters, size: (
            ("buffer", {"buffer": "float"}),
            ("resolution", {"tolerance": 0.0, "evaluation": "pixel"}),
            ("order", {"order": "exact"}),
        ),
    ),
    "light-volumes": Method(
        "light-volumes",
        light_volumes,
        "the volume between the light and its shadow map, crossed without marching",
        "Billeter, Sintorn, Assarsson 2010",
        prepare=prepare_light_volumes,
        prepared_from=frozenset({"geometry", "light"}),
        provides_visibility=finds_lit_surfaces,
        by_rays=lambda parameters: parameters.evaluation == "walk",
        frozen=lambda parameters: parameters.evaluation == "walk",  # the crossings of a mesh are counted on the way
        parameters=LightVolumeParameters,
        error_causes=lambda parameters, size: (("resolution", {"tolerance": 0.0}), ("map", None)),
    ),
    "min-max": Method(
        "min-max",
        min_max,
        "epipolar slices with 1D min/max trees over the shadow map; airlight interpolated between samples",
        "Chen, Baran, Durand, Jarosz 2011; Yusov 2013",
        prepare=prepare_min_max,
        prepared_from=frozenset({"geometry", "light"}),
        parameters=MinMaxParameters,
        error_causes=lambda parameters, size: (("resolution", {"sampling": "pixels"}), ("map", None)),
    ),
    "froxel-fog": Method(
        "froxel-fog",
        froxel_fog,
        "scattered light in a grid along the view, summed front to back: what engines ship",
        "Wronski 2014; Hillaire 2015",
        uses_kernel=never,
        prepare=prepare_froxel_fog,
        prepared_from=frozenset({"geometry", "light"}),
        casts_rays=lambda parameters: parameters.shadow == "ray",
        carries=hands_on,
        lights_at_once=always,
        parameters=FroxelFogParameters,
        error_causes=froxel_errors,
    ),
    "soft-shafts": Method(
        "soft-shafts",
        soft_shafts,
        "few points of a light, visibility in few levels, smoothed by bilateral filters",
        "Ali 2016, reconstructed from captions",
        prepare=prepare_soft_shafts,
        prepared_from=frozenset({"geometry", "light"}),
        uses_kernel=never,
        casts_rays=always,
        provides_visibility=always,
        lights_at_once=always,
        by_source=shares_by_source,
        light_points=LightPoints(5, "ring"),
        parameters=SoftShaftsParameters,
        error_causes=soft_shaft_errors,
    ),
    "cloud-octaves": Method(
        "cloud-octaves",
        cloud_octaves,
        "clouds: single scattering that is extinguished less with every octave, what engines do",
        "Wrenninge 2013; Hillaire 2016",
        prepare=prepare_cloud_octaves,
        prepared_from=frozenset({"geometry", "light"}),
        uses_kernel=never,
        casts_rays=always,
        provides_visibility=always,
        renders_clouds=True,
        layers=(*ORDER_LAYERS, OPACITY),
        parameters=CloudOctavesParameters,
    ),
    "cloud-collectors": Method(
        "cloud-collectors",
        cloud_collectors,
        "clouds: light of all orders from where it enters them, found by light maps and the transport of a slab",
        "Bouthors, Neyret, Max, Bruneton, Crassin 2008",
        prepare=prepare_collectors,
        prepared_from=frozenset({"geometry", "light"}),
        uses_kernel=never,
        renders_clouds=True,
        provides_visibility=always,
        casts_rays=always,
        by_rays=always,
        carries=carries,
        layers=(*ORDER_LAYERS, OPACITY),
        parameters=CollectorParameters,
        error_causes=collector_errors,
    ),
}


#: Those of light that is scattered once, in any scene; the others are for clouds.
FOG_METHODS: dict[str, Method] = {name: method for name, method in METHODS.items() if not method.renders_clouds}


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
    raise InputError(
        f"method: got {name!r}, wanted one of {', '.join(METHODS)}, or your own 'module:function'"
        f"{nearest(name, METHODS)}"
    )
