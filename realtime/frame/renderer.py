# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays, the lit surface, what the method sorts by tiles, and the airlight; each stage one frozen
function.

Frozen functions (`drjit.freeze`) record their kernels on the first call and replay them afterwards, so a frame costs
its kernels and little else. A method whose arrays change their sizes from frame to frame cannot be frozen. All that
moves (camera, lights, medium, shadow maps) is passed in as opaque arrays. What of a frame serves the next one too:
`realtime.frame.incremental`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.bounded_media.body_views import media_sides
from realtime.errors import InputError
from realtime.frame.frame_view import frame_view
from realtime.frame.recorded import Frozen
from realtime.frame.surface import Cast
from realtime.frame.surface_stages import no_surface, surface_stages
from realtime.kernels.table import resident_tables
from realtime.methods.registry import Method
from realtime.scene.camera import tiled_pixels
from realtime.scene.read_scene import Scene
from realtime.tiles.adaptive_sampling import between_corners, tile_corners


@dataclass(frozen=True)
class FrameRenderer:
    """The stages of a frame of one scene with one method, ready to be run any number of times."""

    scene: Scene
    method: Method
    pixel: Any  #: pixel numbers in the order of the lanes
    prepare: Callable[[Scene], Any]  #: what the method needs before the frame: shadow maps, shadow planes
    surface: Callable[..., Any]  #: -> what camera rays meet, and what `shade` returns for it
    shade: Callable[..., Any]  #: -> surface radiance: by light where `airlight` finds shadows, or a sum
    tiles: Callable[..., Any] | None  #: -> what the method sorts by tiles; None where it does not
    airlight: Callable[..., Any]  #: -> airlight radiance, and that of the surface where this finds its shadows, or None
    corners: Any  #: how the tiles of the image lie; None where every pixel is computed
    shade_casts_rays: bool  #: whether shading asks Mitsuba for shapes or shadows
    casts_rays: bool  #: whether the method casts rays of its own

    # A frozen function reads all shapes of a scene that it is given anew at every call.

    @property
    def shade_geometry(self) -> Any:
        """The Mitsuba scene if shading needs it."""
        return self.scene.geometry if self.shade_casts_rays else None

    @property
    def geometry(self) -> Any:
        """The Mitsuba scene if the method needs it."""
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
        From `realtime.scene.read_scene.read_scene`.
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
    unknown = set(parameters) - set(method.parameters)
    if unknown:
        known = ", ".join(method.parameters) or "none"
        raise InputError(f"method {method.name}: got a parameter {sorted(unknown)[0]!r}, wanted one of: {known}")
    if method.uses_kernel and kernel is None:
        raise InputError(f"method {method.name}: got no kernel, wanted one of realtime.kernels.registry.KERNELS")
    settings = dict(method.parameters) | parameters
    tolerance = settings.pop("tolerance") if method.tiled else 0.0
    by_rays = method.tiled is not None and method.tiled(settings)
    features, camera = scene.features, scene.camera
    provides_visibility = method.provides_visibility(settings)
    pixel = mi.UInt32(tiled_pixels(camera.width, camera.height))
    corners = tile_corners(pixel, camera, tolerance, by_rays=by_rays, lights=len(scene.lights))
    surface, shade, shade_casts_rays = surface_stages(scene, provides_visibility=provides_visibility)

    def sort_tiles(pixel, camera, medium, lights, prepared, distance):
        assert method.tiles is not None
        shown = {"geometry": None, "medium": medium, "lights": lights, "prepared": prepared}
        return method.tiles(frame_view(camera, pixel, distance, features=features, **shown), **settings)

    def run_method(geometry, pixel, camera, medium, lights, prepared, tiles, distance, by_light, corners=None):
        shown = {"geometry": geometry, "medium": medium, "lights": lights, "prepared": prepared, "tiles": tiles}

        def sample(pixel, distance, tile=None):
            view = frame_view(camera, pixel, distance, features=features, tile=tile, **shown)
            found = method.function(view, kernel=kernel, **settings)
            return found if provides_visibility else (found, ())

        if corners is None:
            airlight, lit = sample(pixel, distance)
        else:
            if features.bounded:
                shown["sides"] = media_sides(medium, lights, camera.origin)
            how = {"width": camera.width, "tolerance": tolerance}
            airlight, lit = between_corners(corners, pixel, distance, sample, **how)
        if not provides_visibility:
            return airlight, None
        return airlight, sum(dr.select(reached, color, 0) for reached, color in zip(lit, by_light))

    # Asked of every scene: it checks the parameters also where nothing casts a shadow.
    prepare = method.prepare(scene, **settings) if method.prepare else _nothing
    if not features.shadows:
        prepare = _nothing
    casts_rays = method.casts_rays(settings)
    tiles = sort_tiles if method.tiles and features.shadows else None
    airlight = run_method
    if method.frozen(settings):
        # Trace one pixel without launching anything: what the method refuses must not be raised while a frozen function
        # is being recorded, which Dr.Jit 1.5 answers by aborting a later recording.
        one = type(camera.origin.x)(1)
        one_pixel = (mi.UInt32(0), camera, scene.medium, scene.lights)
        dark = no_surface(None, None, *one_pixel, None)
        run_method(scene.geometry if casts_rays else None, *one_pixel, prepare(scene), None, one, dark)
        resident = resident_tables()
        airlight = Frozen(run_method, state_fn=lambda *_, **__: resident)
        tiles = tiles and Frozen(sort_tiles)
    dr.eval(pixel)
    return FrameRenderer(
        scene,
        method,
        pixel,
        prepare,
        surface=surface,
        shade=shade,
        tiles=tiles,
        airlight=airlight,
        corners=corners,
        shade_casts_rays=shade_casts_rays,
        casts_rays=casts_rays,
    )


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host in the order of the image."""
    return image_frame(renderer, run_stages(renderer, renderer.prepare(renderer.scene)))


def image_frame(renderer: FrameRenderer, stages) -> Frame:
    """Bring what `run_stages` returned to the host in the order of the image."""
    distance, surface, airlight = stages
    height, width = renderer.scene.camera.height, renderer.scene.camera.width
    light = _image(renderer, airlight, (height, width, 3))
    if renderer.method.check is not None:
        renderer.method.check(light)
    return Frame(
        light,
        _image(renderer, surface, (height, width, 3)),
        _image(renderer, distance, (height, width)),
    )


def run_stages(renderer: FrameRenderer, prepared):
    """Run the stages on the device and return distance, surface and airlight, evaluated, in the order of the lanes."""
    cast, by_light = run_cast_and_shade(renderer)
    return evaluated(cast, by_light, run_tiles_and_airlight(renderer, prepared, cast.distance, by_light))


def evaluated(cast: Cast, by_light, found):
    """Return distance, surface and airlight, evaluated, from what the stages returned."""
    airlight, lit_surface = found
    surface = by_light[0] if lit_surface is None else lit_surface
    dr.eval(cast.distance, surface, airlight)
    return cast.distance, surface, airlight


def run_cast_and_shade(renderer: FrameRenderer) -> tuple[Cast, Any]:
    """Run the stage of camera rays and lit surface; return what the rays meet, and what `run_shade` returns for it."""
    scene = renderer.scene
    return renderer.surface(scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium, scene.lights)


def run_shade(renderer: FrameRenderer, cast: Cast):
    """Run the stage of the lit surface on what was cast for an earlier frame."""
    scene = renderer.scene
    arguments = (scene.facets, renderer.pixel, scene.camera, scene.medium, scene.lights, cast)
    return renderer.shade(renderer.shade_geometry, *arguments)


def run_surface(renderer: FrameRenderer):
    """Run the stage of camera rays and lit surface; return the distance, and what `run_shade` returns."""
    cast, by_light = run_cast_and_shade(renderer)
    return cast.distance, by_light


def run_tiles(renderer: FrameRenderer, prepared, distance):
    """Run the stage of what the method sorts by tiles; None where it has none."""
    scene = renderer.scene
    if renderer.tiles is None:
        return None
    return renderer.tiles(renderer.pixel, scene.camera, scene.medium, scene.lights, prepared, distance)


def run_tiles_and_airlight(renderer: FrameRenderer, prepared, distance, by_light):
    """Run all that comes after the surface; arguments and result as of `run_airlight`."""
    tiles = run_tiles(renderer, prepared, distance)
    return run_airlight(renderer, prepared, distance, by_light, tiles)


def run_airlight(renderer: FrameRenderer, prepared, distance, by_light, tiles=None):
    """Run the stage of the airlight, and return what it does, not evaluated.

    Parameters
    ----------
    renderer, prepared
        The stages, and what their `prepare` returned.
    distance, by_light
        From `run_surface`.
    tiles
        From `run_tiles`; None if the method is to build its own on the way.
    """
    scene = renderer.scene
    if renderer.corners is not None and tiles is None:
        tiles = run_tiles(renderer, prepared, distance)
    arguments = (renderer.pixel, scene.camera, scene.medium, scene.lights, prepared, tiles, distance, by_light)
    return renderer.airlight(renderer.geometry, *arguments, renderer.corners)


def _nothing(scene: Scene) -> tuple[()]:
    return ()


def _image(renderer: FrameRenderer, values, shape):
    lanes = np.array(values)
    lanes = lanes.T if lanes.ndim == 2 else lanes
    image = np.empty_like(lanes)
    image[np.array(renderer.pixel)] = lanes
    return image.reshape(shape)
