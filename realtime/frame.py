# SPDX-License-Identifier: BSD-3-Clause
"""A frame: primary rays, the lit surface and the airlight, each stage one frozen function.

Frozen functions (`drjit.freeze`) record their kernels on the first call and replay them afterwards, so a frame costs
its kernels and little else. A method whose arrays change their sizes from frame to frame cannot be frozen. All that
moves (camera, lights, medium, shadow maps) is passed in as opaque arrays.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from realtime.body_tiles import tile_corners
from realtime.camera import Camera, ray_directions, tiled_pixels
from realtime.errors import InputError
from realtime.frozen import Frozen
from realtime.kernels.table import resident_tables
from realtime.lights import Light
from realtime.media_rays import camera_depths
from realtime.medium import Medium
from realtime.methods import Method
from realtime.plan import Plan
from realtime.scene import Scene
from realtime.surface import lit_surface, visible_surface, visible_triangle
from realtime.view import View


@dataclass(frozen=True)
class FrameRenderer:
    """The stages of a frame of one scene with one method, ready to be run any number of times."""

    scene: Scene
    pixel: Any  #: pixel numbers in the order of the lanes
    prepare: Callable[[Scene], Any]  #: what the method needs before the frame: shadow maps, shadow planes
    surface: Callable[..., Any]  #: -> distance, and surface radiance: by light where `airlight` finds shadows, or a sum
    airlight: Callable[..., Any]  #: -> airlight radiance, and that of the surface where this finds its shadows, or None
    casts_rays: bool  #: whether the method casts rays of its own
    check: Callable[[Any], None] | None = None  #: airlight (height, width, 3) -> raises what is wrong with it

    @property
    def geometry(self) -> Any:
        """The Mitsuba scene if the method needs it: a frozen function reads all of its shapes anew at every call."""
        return self.scene.geometry if self.casts_rays else None


@dataclass(frozen=True)
class Frame:
    """What a frame shows, as float arrays of shape (height, width[, 3])."""

    airlight: Any  #: in-scattered radiance [W/(m^2 sr)]
    surface: Any  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Any  #: to the visible surface, infinite where there is none [m]


def frame_renderer(scene: Scene, method: Method, *, kernel=None, **parameters) -> FrameRenderer:
    """Prepare the stages of a frame.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene`.
    method
        A real-time method.
    kernel
        An airlight kernel function; needed where `method.uses_kernel`.
    parameters
        Parameters of the method; the others have its defaults.

    Raises
    ------
    InputError
        For a parameter that the method does not have, where a kernel is missing, and for what method or kernel refuse;
        what the kernel of a method that is not frozen refuses comes with the first frame.
    """
    import drjit as dr
    import mitsuba as mi

    unknown = set(parameters) - set(method.parameters)
    if unknown:
        known = ", ".join(method.parameters) or "none"
        raise InputError(f"method {method.name}: got a parameter {sorted(unknown)[0]!r}, wanted one of: {known}")
    if method.uses_kernel and kernel is None:
        raise InputError(f"method {method.name}: got no kernel, wanted one of realtime.kernels.KERNELS")
    settings = dict(method.parameters) | parameters
    plan, camera = scene.plan, scene.camera
    lights_surfaces = method.lights_surfaces(settings)
    pixel = mi.UInt32(tiled_pixels(camera.width, camera.height))

    @Frozen
    def surface(geometry, facets, pixel, camera, medium, lights):
        direction, _ = ray_directions(camera, pixel)
        seen = visible_surface(geometry, facets, camera.origin, direction, color=type(medium.albedo))
        depths = None
        if medium.bodies:
            corners = _corners(camera, pixel)
            depths = camera_depths(medium, camera.origin, direction, seen.distance, corners=corners)
        # A map of a light at infinity shows the media alone, but not all that is lit.
        asked = [light.kind == "directional" or not lights_surfaces for light in lights]
        shown = {"medium": medium, "depths": depths}
        colors = [lit_surface(geometry, seen, light=light, shadows=one, **shown) for light, one in zip(lights, asked)]
        return seen.distance, tuple(colors) if lights_surfaces else (sum(colors),)

    def run_method(geometry, pixel, camera, medium, lights, prepared, distance, by_light):
        shown = {"geometry": geometry, "medium": medium, "lights": lights, "prepared": prepared}
        view = frame_view(camera, pixel, distance, plan=plan, **shown)
        found = method.function(view, kernel=kernel, **settings)
        if not lights_surfaces:
            return found, None
        airlight, lit = found
        return airlight, sum(dr.select(reached, color, 0) for reached, color in zip(lit, by_light))

    # Asked of every scene: it checks the parameters also where nothing casts a shadow.
    prepare = method.prepare(scene, **settings) if method.prepare else _nothing
    if not plan.shadows:
        prepare = _nothing
    casts_rays = method.casts_rays(settings)
    airlight = run_method
    if method.frozen(settings):
        # Trace one pixel without launching anything: what the method refuses must not be raised while a frozen function
        # is being recorded, which Dr.Jit 1.5 answers by aborting a later recording.
        one = type(camera.origin.x)(1)
        one_pixel = (scene.geometry if casts_rays else None, mi.UInt32(0), camera, scene.medium, scene.lights)
        _, dark = _no_surface(None, None, *one_pixel[1:])
        run_method(*one_pixel, prepare(scene), one, dark)
        resident = resident_tables()
        airlight = Frozen(run_method, state_fn=lambda *_, **__: resident)
    dr.eval(pixel)
    shown = surface if plan.surfaces else _no_surface
    return FrameRenderer(scene, pixel, prepare, shown, airlight, casts_rays, method.check)


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host in the order of the image."""
    return image_frame(renderer, run_stages(renderer, renderer.prepare(renderer.scene)))


def image_frame(renderer: FrameRenderer, stages) -> Frame:
    """Bring what `run_stages` returned to the host in the order of the image."""
    distance, surface, airlight = stages
    height, width = renderer.scene.camera.height, renderer.scene.camera.width
    light = _image(renderer, airlight, (height, width, 3))
    if renderer.check is not None:
        renderer.check(light)
    return Frame(
        light,
        _image(renderer, surface, (height, width, 3)),
        _image(renderer, distance, (height, width)),
    )


def run_stages(renderer: FrameRenderer, prepared):
    """Run the stages on the device and return distance, surface and airlight, evaluated, in the order of the lanes."""
    import drjit as dr

    distance, by_light = run_surface(renderer)
    airlight, lit_surface = run_airlight(renderer, prepared, distance, by_light)
    surface = by_light[0] if lit_surface is None else lit_surface
    dr.eval(distance, surface, airlight)
    return distance, surface, airlight


def run_surface(renderer: FrameRenderer):
    """Run the stage of the surface and return what it does, not evaluated."""
    scene = renderer.scene
    return renderer.surface(scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium, scene.lights)


def run_airlight(renderer: FrameRenderer, prepared, distance, by_light):
    """Run the stage of the airlight on what `run_surface` returned, and return what it does, not evaluated."""
    scene = renderer.scene
    arguments = (renderer.pixel, scene.camera, scene.medium, scene.lights, prepared, distance, by_light)
    return renderer.airlight(renderer.geometry, *arguments)


def frame_view(
    camera: Camera, pixel, distance, *, plan: Plan, geometry, medium: Medium, lights: tuple[Light, ...], prepared
) -> View:
    """Return what a method is given for some pixels; `geometry` may be None where the method casts no rays."""
    direction, low = ray_directions(camera, pixel)
    return View(
        origin=camera.origin,
        direction=direction,
        direction_low=low,
        distance=distance,
        lights=lights,
        medium=medium,
        plan=plan,
        visible=lambda point, light: _visible(geometry, point, light),
        camera=camera,
        pixel=pixel,
        rays=_rays(camera, pixel),
        square_tiles=_in_square_tiles(camera, pixel),
        visible_triangle=lambda: visible_triangle(geometry, camera.origin, direction),
        prepared=prepared,
    )


def _rays(camera: Camera, pixel):
    """Return the function from lanes to the directions of their rays."""
    import drjit as dr
    import mitsuba as mi

    return lambda lane: ray_directions(camera, dr.gather(mi.UInt32, pixel, lane))


def _in_square_tiles(camera: Camera, pixel) -> bool:
    import drjit as dr

    return camera.width % 4 == 0 and camera.height % 4 == 0 and dr.width(pixel) > 1


def _corners(camera: Camera, pixel):
    """Return the directions at the corners of the tiles, or None where pixels do not come in tiles."""
    import drjit as dr

    return tile_corners(_rays(camera, pixel), dr.width(pixel)) if _in_square_tiles(camera, pixel) else None


def _visible(geometry, point, light):
    """Cast a shadow ray from the light, where nothing can block it at once, to just before the point."""
    import drjit as dr
    import mitsuba as mi

    if light.kind == "directional":
        # From the point on, where a ray is exact, though not from the surface that it may lie on.
        away = 2e-6 * light.face.depth
        return ~geometry.ray_test(mi.Ray3f(mi.Point3f(point - light.axis * away), mi.Vector3f(-light.axis)))
    start = mi.Point3f(light.position)
    direction = mi.Vector3f(point) - mi.Vector3f(start)
    length = dr.norm(direction)
    # Twenty units in the last place before the point: on a surface the point itself must not block the light.
    return ~geometry.ray_test(mi.Ray3f(start, direction / length, length * (1 - 2e-6), 0.0, []))


def _nothing(scene: Scene) -> tuple[()]:
    return ()


def _no_surface(geometry, facets, pixel, camera, medium, lights):
    import drjit as dr

    Float, Color = type(camera.origin.x), type(medium.albedo)
    return dr.full(Float, dr.inf, dr.width(pixel)), tuple(dr.zeros(Color, dr.width(pixel)) for _ in lights)


def _image(renderer: FrameRenderer, values, shape):
    import numpy as np

    lanes = np.array(values)
    lanes = lanes.T if lanes.ndim == 2 else lanes
    image = np.empty_like(lanes)
    image[np.array(renderer.pixel)] = lanes
    return image.reshape(shape)
