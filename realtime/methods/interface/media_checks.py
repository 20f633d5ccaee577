# SPDX-License-Identifier: BSD-3-Clause
"""Which media and lights a method renders: those of fog, or clouds of any
shape under suns and a sky.

Methods of fog ask the medium for the airlight of lit segments, so it has to be homogeneous, bounded
by convex shapes, height fog, or, for methods that march, a grid. Methods of clouds cast rays at
boundaries of any shape, under lights at infinity.
"""

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.scene.read_scene import Scene


def check_media(scene: Scene, method: Method) -> None:
    """Refuse a scene whose media, or lights for them, a method does not render.

    Raises
    ------
    InputError
        With the name of what is in the way, and of methods that render it.
    """
    near = [light.kind for light in scene.lights if light.w]
    near += [f"area ({light.kind})" for light in scene.area_lights]
    if method.renders_clouds:
        _check_clouds(scene, method, near)
    else:
        _check_fog(scene, method, near)


def _check_fog(scene: Scene, method: Method, near: list[str]) -> None:
    """Refuse clouds, a sky, and a grid where integrals are asked of a kernel; `near`:
    kinds of lights with a place.
    """
    medium, prefix = scene.medium, f"method {method.name}: the"
    instead = "use cloud-collectors or cloud-octaves"
    # Methods of clouds have suns alone, so a lamp leaves no way but another medium.
    if medium.clouds is not None and medium.clouds.density is not None:
        way_out = (
            f"replace it, since no method has one with a light of kind {near[0]}"
            if near
            else instead
        )
        raise InputError(
            f"{prefix} scene has a heterogeneous medium, and this method knows media of type "
            "'homogeneous' only; "
            f"{way_out}"
        )
    # Media with convex bounds are `bounded_media` as well as clouds; where there are none, some
    # bound is not convex.
    if medium.clouds is not None and not medium.bounded_media:
        shapes = ", ".join(repr(shape.id()) for shape in scene.boundaries[:3])
        raise InputError(
            f"{prefix} bounds of the media are not all convex, and these rays cross convex bounds "
            "only (shapes "
            f"{shapes}); {instead}, or cut the shapes into convex parts"
        )
    # Light from all directions has no segment of a ray that it lights, and no kernel.
    if any(light.sky is not None for light in scene.lights):
        raise InputError(
            f"{prefix} scene has a sky, an emitter of type 'constant', which this method does not "
            f"know; {instead}, or "
            "remove it"
        )
    # A medium whose depths are walks has no integral that a kernel knows.
    if medium.sums_depth and method.uses_kernel:
        raise InputError(
            f"{prefix} medium is a density grid, and this method adds up integrals of lit "
            "segments, for which no "
            "kernel knows a grid; use froxel-fog, soft-shafts, or ray-march with sum=steps"
        )


def _check_clouds(scene: Scene, method: Method, near: list[str]) -> None:
    """Refuse media that are no clouds, and lights with a place; `near`: their kinds."""
    if scene.medium.clouds is None:
        raise InputError(
            f"method {method.name}: the scene has no clouds; expected media with closed bounds in "
            "vacuum: give the "
            "medium bounds, or use another method"
        )
    if near:
        raise InputError(
            f"method {method.name}: the scene has a light of kind {near[0]}, and clouds are lit "
            "from infinity; "
            "expected emitters of type 'directional', and at most one 'constant': replace it or "
            "remove it"
        )
