# SPDX-License-Identifier: BSD-3-Clause
"""Real-time methods by name.

`METHODS` is the registry: add a class to it and every command and report knows it. `find_method` also finds a user's
own, which is not in it.
"""

from airlight.realtime.errors import InputError
from airlight.realtime.methods.cloud_collectors import CloudCollectors
from airlight.realtime.methods.cloud_octaves import CloudOctaves
from airlight.realtime.methods.epipolar.method import MinMax
from airlight.realtime.methods.equi_angular import EquiAngular
from airlight.realtime.methods.froxel_fog.method import FroxelFog
from airlight.realtime.methods.history import ENDING, with_history
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.methods.light_volumes.method import LightVolumes
from airlight.realtime.methods.ray_march import RayMarch
from airlight.realtime.methods.shader.method import shader_method
from airlight.realtime.methods.shader.source import is_shader
from airlight.realtime.methods.shadow_planes.method import ShadowPlanes
from airlight.realtime.methods.soft_shafts.method import SoftShafts
from airlight.realtime.methods.unshadowed import Unshadowed
from airlight.realtime.methods.user_method import user_method
from airlight.realtime.parameters import nearest

_ALL = (
    Unshadowed,
    RayMarch,
    EquiAngular,
    ShadowPlanes,
    LightVolumes,
    MinMax,
    FroxelFog,
    SoftShafts,
    CloudOctaves,
    CloudCollectors,
)

METHODS: dict[str, type[Method]] = {method.name: method for method in _ALL}

#: Those of light that is scattered once, in any scene, without random numbers by default; the others are for clouds.
FOG_METHODS: dict[str, type[Method]] = {
    name: method for name, method in METHODS.items() if not (method.renders_clouds or method().noisy)
}


def find_method(name: str) -> type[Method]:
    """Return a method.

    `name`: a name of `METHODS`, or a user's own: 'module:function', 'path/to/file.py:function'
    (`realtime.methods.user_method`), 'path/to/file.glsl' (`realtime.methods.shader`); with '+history' behind it,
    averaged over frames. Raises InputError for an unknown name (the nearest is named), and for what cannot be imported
    or is no method.
    """
    if name.endswith(ENDING):
        if is_shader(own := name.removesuffix(ENDING)):
            raise InputError(f"method {name}: a shader keeps its own frames; expected its name without '{ENDING}'")
        return with_history(find_method(own))
    if name in METHODS:
        return METHODS[name]
    if is_shader(name):
        return shader_method(name)
    if ":" in name:
        return user_method(name)
    raise InputError(
        f"method: got {name!r}, expected one of {', '.join(METHODS)}, 'module:function', or a shader, 'fog.glsl'"
        f"{nearest(name, METHODS)}"
    )
