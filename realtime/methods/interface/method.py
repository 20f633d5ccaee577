# SPDX-License-Identifier: BSD-3-Clause
"""A method: its parameters, what it makes of a scene, and the airlight of a light.

A method is a frozen dataclass derived from `Method`; its fields are its parameters. It has two
functions, each for one light: `prepare` makes the state that a scene needs once, such as a shadow
map, and `airlight` returns the radiance that the lit media scatter into each camera ray. Everything
else that a frame must know is a class attribute or property with a default, so a method states only
what differs. A user's plain function becomes such a class too (`realtime.methods.user_method`).

A frame shows

    surface * visibility * transmittance + in_scattered + transmittance * background,

in which `surface` is the light of a lamp that the visible surface reflects to the camera, through
the medium of the scene and without shadows, summed over the lamps.

A method is given a view: the camera rays of a frame, the lights and the media.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.numerics.array_types import Metres, PerRay
from airlight.realtime.numerics.noise import PATTERNS, Noise
from airlight.realtime.parameters import Parameters, defaults, parameter, read_parameters, values
from airlight.realtime.rays import RayGeometry, ray_geometry
from airlight.realtime.scene.camera import Camera, ray_directions, row_and_column
from airlight.realtime.scene.light_table import LightTable
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import LitRays, Medium, Rays
from airlight.realtime.scene.read_scene import Scene, SceneFeatures


@dataclass(frozen=True)
class View(Rays):
    """The rays of a frame and all that scatters light into them, as Dr.Jit arrays
    with one entry per pixel.
    """

    distance: Metres  #: to the visible surface, infinite where there is none [m]
    tables: tuple[LightTable, ...]  #: the lights, a table for each structure and area light
    medium: Medium
    features: SceneFeatures  #: what the scene needs; a method leaves out the rest
    camera: Camera
    pixel: PerRay  #: pixel number of every ray: row times width plus column
    #: the Mitsuba scene, for casting rays; None where the method says that it casts none
    scene: Any = None
    #: of a light, what the visible surfaces send back unshadowed [W/(m^2 sr)]; None where there
    #: are none, or where shadow rays light them
    reflected: Callable[[Light], PerRay] | None = None
    prepared: Any = ()  #: for a user's plain function: what its `prepare` made
    extra_layers: bool = False  #: whether the image is to have `Layers.extra`
    carried: Any = None  #: the `Layers.carried` of the last frame; None in the first
    #: what draws random numbers; None for a method that does not say that it is `noisy`
    noise: Noise | None = None

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights one by one, for code that does not loop over tables: a
        kernel then grows with them.
        """
        return tuple(table[number] for table in self.tables for number in range(table.count))

    @property
    def run(self) -> Any:
        """The number of the run, an opaque `mi.UInt32`: images of two runs are independent.

        Raises
        ------
        InputError
            For a method that does not say that it is noisy.
        """
        return self.random.run

    @property
    def frame(self) -> Any:
        """The number of the frame in its run, an opaque `mi.UInt32`: a frozen method
        draws new numbers in each.
        """
        return self.random.frame

    def uniform(self, stream: int = 0) -> tuple[Any, Any, Any, Any]:
        """Return four independent numbers for each ray, evenly distributed in [0, 1), other
        ones in each frame and run.

        Numbers of two streams are independent.

        Raises
        ------
        InputError
            For a method that does not say that it is noisy.
        """
        first, second, third, fourth = map(
            type(self.distance), self.random.uniform(self.pixel, stream)
        )
        return first, second, third, fourth

    def pattern(self, kind: str, *, golden: bool = False, stream: int = 0) -> PerRay:
        """Return a number from 0 to 1 for each ray by which samples are shifted, evenly
        distributed over the runs.

        Parameters
        ----------
        kind
            'white', 'blue' or 'ign', see `realtime.numerics.noise`.
        golden
            Whether frames differ by the golden ratio, in place of the pattern's own change.
        stream
            Patterns of two streams are independent over the runs.

        Raises
        ------
        InputError
            For a method that does not say that it is noisy.
        """
        place = row_and_column(self.camera, self.pixel)
        shown = {"golden": golden, "pixel": self.pixel, "place": place, "stream": stream}
        return type(self.distance)(self.random.pattern(kind, **shown))

    @property
    def random(self) -> Noise:
        """The random numbers of this frame of this run."""
        if self.noise is None:
            raise InputError(
                "noise: the method draws random numbers and does not say so; expected `noisy` = "
                "True"
            )
        return self.noise

    def visible(self, point, light: Any, asked=True):
        """Return whether a light, or what else has a `shadow_ray`, reaches points [m], by
        rays where they are `asked`.

        Raises
        ------
        InputError
            For a method that says that it casts no rays.
        """
        if self.scene is None:
            raise InputError(
                "visible: the method says that it casts no rays, and asks for some; expected "
                "`casts_rays`"
            )
        return ~self.scene.ray_test(light.shadow_ray(point), asked)

    def geometry(self, light: Light) -> RayGeometry:
        """Return where the rays pass a light: foot, height, and what of them it could reach."""
        return ray_geometry(self.origin, self.aim, light)

    def lit_by(self, light: Light, kernel: Any = None) -> LitRays:
        """Return the rays with one light, which the medium integrates.

        Parameters
        ----------
        light, kernel
            One of `lights`, and an airlight kernel, or None where no integral is asked for.
        """
        return self.medium.lit(self, light, self.geometry(light), kernel)

    def of_pixels(self, pixel: PerRay, distance: Metres) -> "View":
        """Return the view of other pixels of the image; `distance` [m] is that
        to their visible surfaces.
        """
        rays = self.medium.rays(self.origin, *ray_directions(self.camera, pixel))
        return replace(self, **vars(rays), distance=distance, pixel=pixel)


def camera_view(
    camera: Camera,
    pixel: PerRay,
    distance: Metres,
    *,
    features: SceneFeatures,
    scene,
    medium: Medium,
    tables,
) -> View:
    """Return the view of some pixels; `distance`: to the visible surface [m]."""
    rays = medium.rays(camera.origin, *ray_directions(camera, pixel))
    own = {"features": features, "camera": camera, "pixel": pixel, "scene": scene}
    return View(**vars(rays), distance=distance, tables=tables, medium=medium, **own)


#: Parts of a scene that may change between frames; `look` is all without motion: the medium
#: and the lights' colours.
MOVABLE = ("camera", "geometry", "light", "look")

#: Preparation of a frame when things moved: a function of the present scene that
#: returns the method's state.
Preparation = Callable[[Scene], Any]

#: A cause of errors, and the values of parameters with which it is gone; None: all
#: that the method has left.
ErrorCause = tuple[str, Mapping[str, Any] | None]


@dataclass(frozen=True)
class Layers:
    """The results of a method for every ray. Layers that it leaves out cost nothing."""

    in_scattered: PerRay  #: radiance that the media scatter into the ray, a colour [W/(m^2 sr)]
    #: By light, or one for all samples of each area light, which fraction of it reaches the
    #: surface: 0 to 1, a mask, or a function of a sample and its number that returns one of
    #: these; None: shadow rays say it.
    visibility: tuple[PerRay | Callable[[Light, Any], PerRay], ...] | None = None
    #: of what the method adds to the scene's media; None: all passes
    transmittance: PerRay | None = None
    #: radiance from behind all media, 0 where a surface hides it [W/(m^2 sr)]
    background: PerRay | None = None
    #: Further layers of the image by their names, radiance [W/(m^2 sr)] or fractions, only
    #: where the view asks for them
    extra: Mapping[str, PerRay] | None = None
    carried: Any = None  #: arrays that the next frame finds in its view; see `Method.carries`


@dataclass(frozen=True)
class Method(Parameters):
    """A method with the values of its parameters.

    Most methods have `prepare` and `airlight`. One that looks at all lights together overrides
    `preparation` and `render` instead.
    """

    name: ClassVar[str] = ""
    summary: ClassVar[str] = "a user method"  #: what it does, for tables
    source: ClassVar[str] = "the user"  #: the paper
    as_published: ClassVar[str] = ""  #: the method that does what the paper does
    #: whether it knows shadows; one that does not is wrong where there are occluders
    shadows: ClassVar[bool] = True
    #: Whether it knows clouds of any shape and a sky. Then it says itself how the media attenuate
    #: the surfaces, and has `Layers.extra` by order of scattering.
    renders_clouds: ClassVar[bool] = False
    light_samples: ClassVar[LightSamples] = LightSamples()  #: how it renders area lights by default

    # Facts for the frame. Each may be a property that follows from the parameters.
    #: what `prepare` looks at; else its state is kept
    prepared_from: ClassVar[frozenset[str]] = frozenset(MOVABLE)
    provides_visibility: ClassVar[bool] = False  #: whether it says which surfaces its lights reach
    #: whether each ray is computed by itself, so that any pixels can be rendered alone
    by_rays: ClassVar[bool] = False
    frozen: ClassVar[bool] = True  #: whether Dr.Jit can record it once and replay it
    #: whether it is given all lights and light samples of a frame at once
    at_once: ClassVar[bool] = False
    #: whether it hands arrays on to the next frame, as `Layers.carried`
    carries: ClassVar[bool] = False
    #: how frames are averaged (`realtime.methods.history.History`); None: not at all
    history: ClassVar[Any] = None

    def check(self, scene: Scene) -> None:
        """Refuse a scene, by `InputError`, that the method with these parameters cannot render."""

    def prepare(self, scene: Scene, light: Light) -> Any:
        """Return the state for `airlight` of a scene and one light; called only where
        something casts a shadow.
        """

    def airlight(self, view: View, light: Light, state: Any, kernel: Any) -> Any:
        """Return the radiance that one light has scattered into every ray [W/(m^2 sr)].

        Parameters
        ----------
        view
            The rays.
        light
            One of `view.lights`.
        state
            From `prepare`; None where nothing casts a shadow.
        kernel
            An airlight kernel, see `realtime.kernels`; None where `uses_kernel` is false.

        Returns
        -------
        radiance
            A colour. Where `provides_visibility`, a pair: that, and which fraction of the
            light reaches the surface.
        """
        raise NotImplementedError

    def preparation(self, scene: Scene) -> Preparation:
        """Return a function that makes the state of all lights; constant data of
        the scene are read here. Scenes have their lights in the order of `View.lights`.
        """
        if self.by_table or not scene.features.shadows:
            return no_state
        return lambda now: tuple(self.prepare(now, light) for light in now.lights)

    def render(self, view: View, state: Any, kernel: Any) -> Layers:
        """Return the layers of every ray: the sum over the lights."""
        if self.by_table:
            total = dr.zeros(type(view.medium.albedo), dr.width(view.pixel))
            for table, states in zip(view.tables, state or (None,) * len(view.tables), strict=True):

                def scattered(light: Light, number: Any, states: Any = states) -> Any:
                    own = None if states is None else states.of(number, light)
                    return self.airlight(view, light, own, kernel)

                total = table.sum(scattered, total)
            return Layers(total)
        total, visibility = type(view.medium.albedo)(0), []
        for light, own in zip(view.lights, state or (None,) * len(view.lights), strict=True):
            found = self.airlight(view, light, own, kernel)
            if self.provides_visibility:
                found, reached = found
                visibility.append(reached)
            total += found
        return Layers(total, tuple(visibility) if self.provides_visibility else None)

    @property
    def by_table(self) -> bool:
        """Whether lights that are alike are one loop: by default, if `airlight` needs no state and
        returns the radiance alone.

        A method whose `preparation` makes a state for each table says so; each state has a
        function `of(number, light)`, which returns that of a light for `airlight`.
        """
        own, other = type(self), Method
        return not self.provides_visibility and (own.prepare, own.preparation, own.render) == (
            other.prepare,
            other.preparation,
            other.render,
        )

    @property
    def uses_kernel(self) -> bool:
        """Whether it calls an airlight kernel: by default, if it has an `airlight`."""
        return type(self).airlight is not Method.airlight

    @property
    def casts_rays(self) -> bool:
        """Whether it asks `View.visible` or the geometry: by default, with
        the parameter shadow=ray.
        """
        return getattr(self, "shadow", "") == "ray"

    @property
    def noisy(self) -> bool:
        """Whether its image depends on the number of the run, as `View.run`: by
        default, by the word `jitter`.
        """
        jitter = getattr(self, "jitter", "none")
        return isinstance(jitter, str) and jitter != "none"

    def error_causes(self, size: tuple[int, int]) -> tuple[ErrorCause, ...]:
        """Return the causes of its errors in an image of that size [pixels].

        They come in the order in which `airlight study decomposition` takes them away,
        one on top of the other.
        """
        return ()


def no_state(scene: Scene) -> tuple[()]:
    """Return the state of a method that makes none."""
    return ()


def jitter() -> Any:
    """Return the field of the parameter by which the samples of rays are shifted."""
    return parameter(
        "none",
        "shift of the samples of a ray: none, white noise, a mask of blue noise, or interleaved "
        "gradient noise",
        choices=("none", *PATTERNS),
    )


def animate() -> Any:
    """Return the field of the parameter by which the pattern of `jitter`
    changes from frame to frame.
    """
    return parameter(
        "none",
        "a new pattern in every frame, or that of frame 0 plus the frame's number times the golden "
        "ratio",
        choices=("none", "golden"),
    )


def method_parameters(
    method: type[Method], given: Mapping[str, Any]
) -> tuple[Method, LightSamples]:
    """Return a method with its parameters, and those of area lights, which
    all methods have in common.

    `given` are values by name; a word is converted to the type of the default.

    Raises
    ------
    InputError
        As `realtime.parameters.read_parameters`.
    """
    common = [item.name for item in fields(LightSamples) if item.name not in defaults(method)]
    own = {name: value for name, value in given.items() if name not in common}
    asked = {name: value for name, value in given.items() if name in common}
    chosen = read_parameters(method.name, method, own, others=common, see=method.as_published)
    read = values(read_parameters(method.name, LightSamples, asked))
    return chosen, replace(method.light_samples, **{name: read[name] for name in asked})
