# SPDX-License-Identifier: BSD-3-Clause
"""Real-time methods by name.

`METHODS` is the registry: a line of `_CLASSES`, the module and the class, and every command and
report knows it. `find_method` also finds a user's own, which is not in it. A class is loaded when
it is asked for: a frame of fog loads neither clouds nor shaders.
"""

from collections.abc import Iterator, Mapping
from importlib import import_module

from airlight.errors import InputError, nearest
from airlight.realtime.methods.history import ENDING, with_history
from airlight.realtime.methods.interface.method import Method

#: By name, the module and the class. The key of a result counts the code of the modules
#: that are named here in full.
_CLASSES: Mapping[str, tuple[str, str]] = {
    "unshadowed": ("airlight.realtime.methods.unshadowed", "Unshadowed"),
    "ray-march": ("airlight.realtime.methods.ray_march", "RayMarch"),
    "equi-angular": ("airlight.realtime.methods.equi_angular", "EquiAngular"),
    "shadow-planes": ("airlight.realtime.methods.shadow_planes.method", "ShadowPlanes"),
    "light-volumes": ("airlight.realtime.methods.light_volumes.method", "LightVolumes"),
    "min-max": ("airlight.realtime.methods.epipolar.method", "MinMax"),
    "froxel-fog": ("airlight.realtime.methods.froxel_fog.method", "FroxelFog"),
    "soft-shafts": ("airlight.realtime.methods.soft_shafts.method", "SoftShafts"),
    "shadow-planes-2006": (
        "airlight.realtime.methods.published.biri2006.method",
        "ShadowPlanes2006",
    ),
    "light-volumes-2010": (
        "airlight.realtime.methods.published.billeter2010.method",
        "LightVolumes2010",
    ),
    "cloud-collectors-2008": (
        "airlight.realtime.methods.published.bouthors2008",
        "CloudCollectors2008",
    ),
    "cloud-octaves": ("airlight.realtime.methods.cloud_octaves", "CloudOctaves"),
    "cloud-collectors": ("airlight.realtime.methods.cloud_collectors", "CloudCollectors"),
}

#: Methods for light that is scattered once, in any scene, without random numbers by default.
FOG_METHODS = (
    "unshadowed",
    "ray-march",
    "shadow-planes",
    "light-volumes",
    "min-max",
    "froxel-fog",
    "soft-shafts",
)
#: Methods with the errors of a paper, to judge the paper.
PUBLISHED_METHODS = ("shadow-planes-2006", "light-volumes-2010", "cloud-collectors-2008")


class _Methods(Mapping[str, type[Method]]):
    def __getitem__(self, name: str) -> type[Method]:
        module, class_name = _CLASSES[name]
        method: type[Method] = getattr(import_module(module), class_name)
        return method

    def __iter__(self) -> Iterator[str]:
        return iter(_CLASSES)

    def __len__(self) -> int:
        return len(_CLASSES)


#: The methods by name; the module of a method is imported when it is asked for.
METHODS: Mapping[str, type[Method]] = _Methods()


def find_method(name: str) -> type[Method]:
    """Return a method.

    Parameters
    ----------
    name
        A name of `METHODS`, or a user's own: 'module:function', 'path/to/file.py:function'
        (`realtime.methods.user_method`), 'path/to/file.glsl' (`realtime.methods.shader`); with
        '+history' behind it, averaged over frames.

    Raises
    ------
    InputError
        For an unknown name (the nearest is named), and for what cannot be imported or is no method.
    """
    # Shaders and users' methods are imported here, as few frames need them.
    if name in METHODS:
        return METHODS[name]
    from airlight.realtime.methods.shader.source import is_shader

    # '+history' is a name with an ending, whatever stands before it: built in, or a user's.
    if name.endswith(ENDING):
        if is_shader(base := name.removesuffix(ENDING)):
            raise InputError(
                f"method {name}: a shader keeps its own frames; expected its name without "
                f"'{ENDING}'"
            )
        return with_history(find_method(base))
    if is_shader(name):
        from airlight.realtime.methods.shader.method import shader_method

        return shader_method(name)
    if ":" in name:
        from airlight.realtime.methods.user_method import user_method

        return user_method(name)
    raise InputError(
        f"method: got {name!r}, expected one of {', '.join(METHODS)}, 'module:function', or a "
        "shader, 'fog.glsl'"
        f"{nearest(name, METHODS)}"
    )
