# SPDX-License-Identifier: BSD-3-Clause
"""What a method is given: the camera rays of a frame, the lights and the media."""

from dataclasses import dataclass, replace
from typing import Any

from realtime.errors import InputError
from realtime.numerics.array_types import Metres, PerRay
from realtime.rays.ray_light import RayGeometry, ray_geometry
from realtime.scene.camera import Camera, ray_directions
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.media.medium import LitRays, Medium, Rays


@dataclass(frozen=True)
class View(Rays):
    """The rays of a frame and all that scatters light into them, as Dr.Jit arrays with one entry per pixel."""

    distance: Metres  #: to the visible surface, infinite where there is none [m]
    lights: tuple[Light, ...]
    medium: Medium
    features: SceneFeatures  #: what the scene needs; a method leaves out the rest
    camera: Camera
    pixel: PerRay  #: pixel number of every ray: row times width plus column
    scene: Any = None  #: the Mitsuba scene, for casting rays; None where the method says that it casts none
    surfaces: tuple[PerRay, ...] | None = None  #: by light, what the visible surface sends back unshadowed
    prepared: Any = ()  #: for a user's plain function: what its `prepare` made
    extra_layers: bool = False  #: whether the image is to have `Layers.extra`
    carried: Any = None  #: the `Layers.carried` of the last frame; None in the first

    def visible(self, point, light: Any, asked=True):
        """Return whether a light, or what else has a `shadow_ray`, reaches points [m], by rays where they are `asked`.

        Raises
        ------
        InputError
            For a method that says that it casts no rays.
        """
        if self.scene is None:
            raise InputError("visible: the method says that it casts no rays, and asks for some; wanted `casts_rays`")
        return ~self.scene.ray_test(light.shadow_ray(point), asked)

    def geometry(self, light: Light) -> RayGeometry:
        """Return where the rays pass a light: foot, height, and what of them it could reach."""
        return ray_geometry(self.origin, self.aim, light)

    def lit_by(self, light: Light, kernel: Any = None, *, form: str = "kernel", geometry: Any = None) -> LitRays:
        """Return the rays with one light, which the medium integrates.

        Parameters
        ----------
        light, kernel
            One of `lights`, and an airlight kernel, or None where no integral is asked for.
        form
            In bounded media, see `realtime.scene.media.bounded.BoundedMedia.lit`.
        geometry
            That of the rays and the light, if it is known.
        """
        geometry = self.geometry(light) if geometry is None else geometry
        return self.medium.lit(self, light, geometry, kernel=kernel, form=form)

    def of_pixels(self, pixel: PerRay, distance: Metres) -> "View":
        """Return the view of other pixels of the image; `distance` [m] is that to their visible surfaces."""
        rays = self.medium.rays(self.origin, *ray_directions(self.camera, pixel))
        return replace(self, **vars(rays), distance=distance, pixel=pixel)


def camera_view(
    camera: Camera, pixel: PerRay, distance: Metres, *, features: SceneFeatures, scene, medium: Medium, lights
) -> View:
    """Return what a method is given for some pixels; `distance` [m] is that to the visible surface."""
    rays = medium.rays(camera.origin, *ray_directions(camera, pixel))
    own = {"features": features, "camera": camera, "pixel": pixel, "scene": scene}
    return View(**vars(rays), distance=distance, lights=tuple(lights), medium=medium, **own)
