# SPDX-License-Identifier: BSD-3-Clause
r"""Clouds by collectors: light scattered many times, without a walk through
the volume (Bouthors 2008).

Where a camera ray meets a cloud, or at the camera if that is within one, light leaves towards the
eye. Single scattering is integrated along the ray. The light of each set of orders from 2 on is the
canonical transport from the collector that `realtime.clouds.collector_search` finds for it. Each
sun has its own maps and searches. A uniform sky has no direction and needs no search
(`realtime.clouds.uniform_sky`); `sky=beams` makes it one more sun, which shines from above
(`Light.sky`), as the paper does. The ray dims the surface behind the clouds by its transmittance.

Other clouds dim the light of all orders on its way to a cloud, and opaque shapes hide it: for order
1 along the ray, for the others at the collector, over whose width the shade of other clouds is a
mean.

The peak of a phase function below five degrees is cut from the orders from 2 on, as light in the
peak hardly leaves its way: with f the fraction of the peak and a the albedo, the density is (1 - a
f) sigma_t and the albedo a (1 - f)/(1 - a f); single scattering has P/(1 - a f) with that density
(TMS), so that nothing is counted twice. `peak=matched` takes the f of the phase function, `full`
cuts nothing: only then the sets hold the orders of the medium as it is.

In the orders from 2 on, a ray shows the light that leaves where it first enters a cloud. The slab
of this entry stands for all that the ray meets behind it, further clouds too.

References
----------
Bouthors, Neyret, Max, Bruneton, Crassin 2008, *Interactive multiple anisotropic scattering in
clouds*. Nakajima, Tanaka 1988, *Algorithms for radiative intensity calculations in moderately thick
atmospheres using a truncation approximation* (TMS).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.clouds.canonical.coordinates import (
    OPACITY,
    ORDER_LAYERS,
    SETS,
    fraction_of_peak,
    slab_phase,
)
from airlight.realtime.clouds.canonical.transport_grid import canonical_transport, on_device
from airlight.realtime.clouds.collector_search import (
    Collector,
    OrdersLight,
    Search,
    light_of_orders,
)
from airlight.realtime.clouds.density_maps import (
    LightDepths,
    dense_surface,
    depths_memory,
    lit_dense_surface,
    sun_depths,
)
from airlight.realtime.clouds.light_maps import (
    LightMap,
    filtered_map,
    length_along_light,
    light_map,
    maps_memory,
    shade,
)
from airlight.realtime.clouds.march import (
    CloudSurfaces,
    cloud_surfaces,
    segment_by_lengths,
    segment_through,
)
from airlight.realtime.clouds.single_scattering import (
    Beam,
    CloudRays,
    cloud_rays,
    light_on_surfaces,
    light_once,
    opacity_of,
    sky_behind,
)
from airlight.realtime.clouds.uniform_sky import SkyEscapes, beams_of, sky_escapes, sky_light
from airlight.realtime.memory import check_memory
from airlight.realtime.methods.interface.method import Layers, Method, View
from airlight.realtime.numerics.array_types import ArrayTypes, types_of
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.media.bounded import Clouds
from airlight.realtime.scene.mesh_adjacency import scene_of
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.read_scene import Scene
from airlight.realtime.shadow_maps.shadow_map import map_size


@dataclass(frozen=True)
class CloudCollectors(Method):
    """The light of clouds along every ray, by order of scattering."""

    name = "cloud-collectors"
    summary = "clouds: light of all orders from where it enters them, found by light maps and the transport of a slab"
    source = "Bouthors, Neyret, Max, Bruneton, Crassin 2008"
    as_published = "cloud-collectors-2008"
    renders_clouds = True
    at_once = True
    prepared_from = frozenset({"geometry", "light"})
    casts_rays = True
    provides_visibility = True
    by_rays = True

    iterations: int = parameter(10, "steps of a search at most", least=1, most=1000)
    start: str = parameter(
        "cold",
        "a search starts at the point itself, or with the collector of the last frame",
        choices=("cold", "previous"),
    )
    peak: str = parameter(
        "matched",
        "cut the peak below 5 degrees and lower the density to match, or keep the peak",
        choices=("matched", "full"),
    )
    sky: str = parameter(
        "uniform",
        "the light of a sky, the same from everywhere, or a beam from above of pi times its "
        "radiance, as printed",
        choices=("uniform", "beams"),
    )
    steps: int = parameter(16, "steps of single scattering along a ray", least=1, most=4096)
    threshold: float = parameter(
        0.5,
        "density, as a fraction of the largest, from which on a cloud with a grid of densities has "
        "its surface",
        above=0,
        below=1,
    )
    stride: float = parameter(
        1.0,
        "longest step through a grid of densities where a ray enters",
        above=0,
        most=100,
        unit="voxels",
    )
    map: int = map_size(256, "texels on a side of the maps of a sun")

    @property
    def along_light(self) -> bool:
        """Whether thickness and depth in slabs are those along the light."""
        return False

    def cut(self, phase: Phase, types: ArrayTypes) -> float:
        """Return the fraction of the light of a phase function that is cut from its peak [1]."""
        return fraction_of_peak(phase, types) if self.peak == "matched" else 0.0

    def light_once(
        self, rays: CloudRays, beams: Sequence[Beam], stride: Any
    ) -> tuple[tuple[Any, ...], ...]:
        """Return the radiance that clouds scatter once into rays, by beam and
        octave, RGB [W/(m^2 sr)].
        """
        return light_once(rays, beams, steps=self.steps, stride=stride)

    def opacity_along(self, rays: CloudRays, stride: Any) -> Any:
        """Return the opacity of clouds along rays, a colour [1]."""
        return opacity_of(rays.depths, type(rays.clouds.albedo))

    @property
    def carries(self):
        """Frames hand their collectors on."""
        return self.start == "previous"

    def preparation(self, scene):
        """Return a function that makes the light maps of a frame; grids and
        boundaries are made here, once.

        Raises InputError if the maps need more memory than the machine has.
        """
        return _preparation(scene, self)

    def render(self, view, state, kernel):
        """Return the layers of every ray."""
        return _collected(view, state, self)

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return ("map", {"map": 2048}), ("search", {"iterations": 40}), ("slab", None)


@dataclass(frozen=True)
class Filling:
    """A phase function and an albedo that occur in clouds, and the canonical transport of both."""

    transport: Any
    #: by channel, 1 for each cloud that is filled with it, otherwise 0; None if none is
    clouds: tuple[Any, ...]


@dataclass(frozen=True)
class CloudState:
    """The clouds, and the maps and searches of the suns."""

    surfaces: CloudSurfaces
    maps: tuple[LightMap | None, ...]  #: by light, None for a sky that is no beam
    fillings: tuple[Filling, ...]
    #: by channel, the factor on the extinction of each cloud that cuts the peak, 1 - a f [1]
    extinction_factor: tuple[Any, ...]
    stride: Any  #: longest step through a grid of densities [voxels]
    threshold: Any  #: density at the surface of a cloud with a grid [1]
    #: by sun and cloud, where clouds have densities
    depths: tuple[tuple[LightDepths, ...], ...] = ()
    #: by cloud the mean density above the threshold [1]; None where none has densities
    body: Any = None
    escapes: SkyEscapes | None = None  #: where there is a sky that is no beam


@dataclass(frozen=True)
class _Entry:
    """Where camera rays meet a cloud."""

    point: Any  #: on its boundary, or the camera within it [m]
    cloud: Any  #: its number
    hit: Any  #: whether the ray meets one before the visible surface


def _preparation(scene: Scene, parameters: CloudCollectors) -> Callable[[Scene], CloudState]:
    # Each sun has a map of each cloud, and depths where clouds have densities; their room is
    # counted before any is made.
    filled, clouds = scene.medium.clouds, len(scene.boundaries)
    assert filled is not None
    suns = beams_of(scene.lights, parameters.sky, filled)
    Float, density = type(scene.camera.origin.x), filled.density
    of_each = maps_memory(Float, parameters.map) + (depths_memory(Float) if density else 0)
    needed = len(suns) * clouds * of_each
    check_memory(
        f"map: {parameters.map} texels for {len(suns)} sun(s) and {clouds} cloud(s)",
        needed,
        "use a smaller map",
    )
    fillings, factors = _fillings(scene, parameters)
    surfaces = cloud_surfaces(scene)
    # Every cloud is a scene of its own, so that the rays of its maps meet nothing else.
    bodies = [scene_of((shape,)) for shape in scene.boundaries]
    stride, threshold = (
        dr.opaque(Float, value) for value in (parameters.stride, parameters.threshold)
    )
    cast = Frozen(
        lambda bodies, lights: tuple(light_map(bodies, light, parameters.map) for light in lights)
    )
    # A sky that is no beam is the only light that is not among the suns.
    escapes = sky_escapes(scene) if len(suns) < len(scene.lights) else None

    def state(scene: Scene) -> CloudState:
        # Suns move: their maps are cast for each frame, in one recorded function.
        sun_maps = dict(zip(suns, cast(bodies, [scene.lights[number] for number in suns])))
        maps = tuple(sun_maps.get(number) for number in range(len(scene.lights)))
        return CloudState(surfaces, maps, fillings, factors, stride, threshold, escapes=escapes)

    # The surface of a cloud with densities is where the density passes the threshold, found by a
    # march along the light; the depths of the light come from a march too.
    def marched(scene: Scene) -> CloudState:
        filled = scene.medium.clouds
        assert filled is not None
        depths = sun_depths(surfaces, filled, scene.lights, stride=stride)
        settings = {"body": body, "threshold": parameters.threshold, "stride": stride}
        # The finest level of each cloud by itself, then all levels of the sun's map from them. The
        # number of a cloud is opaque, so that all clouds share one compiled kernel.
        maps = tuple(
            filtered_map(
                [
                    lit_dense_surface(
                        surfaces,
                        filled,
                        light,
                        parameters.map,
                        cloud=dr.opaque(mi.UInt32, cloud),
                        **settings,
                    )
                    for cloud in range(clouds)
                ],
                light,
            )
            for light in scene.lights
        )
        return CloudState(surfaces, maps, fillings, factors, stride, threshold, depths, body)

    if density:
        # The slab of a cloud with densities has their mean above the threshold.
        body = Float([density.mean_above(cloud, parameters.threshold) for cloud in range(clouds)])
        dr.make_opaque(body)
        return marched
    return state


def _fillings(
    scene: Scene, parameters: CloudCollectors
) -> tuple[tuple[Filling, ...], tuple[Any, ...]]:
    """Return the fillings of clouds, each phase function and albedo once, and
    `CloudState.extinction_factor`.
    """
    clouds = scene.medium.clouds
    assert clouds is not None
    # Where extinction and albedos are the same in all channels, one channel is searched.
    types = types_of(type(scene.camera.origin.x))
    phases = np.array(clouds.phase)
    albedos = np.array(clouds.albedo, dtype=np.float64).reshape(3, -1)
    grey = len(clouds.sigma_t) == 1 and np.all(albedos == albedos[0])
    albedos = albedos[:1] if grey else albedos
    fillings, factors = [], np.ones_like(albedos)
    # Each pair of a phase function and an albedo in any channel of any cloud is one medium of
    # slabs, and one table of transport. A cloud of the albedo 0 scatters nothing, and needs none.
    for phase, albedo in sorted(
        {(int(phase), float(value)) for row in albedos for phase, value in zip(phases, row)}
    ):
        if not albedo:
            continue
        phase_function = clouds.phases[phase]
        # Without the fraction f the density has the factor 1 - a f, and the albedo of the orders
        # from 2 on is a (1 - f)/(1 - a f).
        fraction = parameters.cut(phase_function, types)
        filled = (phases == phase) & (albedos == albedo)
        factors[filled] = 1 - albedo * fraction
        medium = (
            slab_phase(phase_function, types, modified=parameters.peak != "full"),
            albedo * (1 - fraction) / (1 - albedo * fraction),
        )
        transport = on_device(canonical_transport(*medium), types)
        # None spares a search in a channel where no cloud is filled with it.
        by_channel = (mi.UInt32(row.astype(np.uint32)) if row.any() else None for row in filled)
        fillings.append(Filling(transport, tuple(by_channel)))
    factors_on_device = tuple(types.scalar(row) for row in factors)
    dr.make_opaque([filling.clouds for filling in fillings], factors_on_device)
    return tuple(fillings), factors_on_device


def _collected(view: View, state: CloudState, parameters: CloudCollectors) -> Layers:
    """Return the light of clouds along every ray [W/(m^2 sr)]."""
    Color = type(view.medium.albedo)
    # Order 1 first, then a sum for each set of orders from 2 on.
    rays, thin_rays = _rays(view, state)
    by_set, collectors = (
        [_scattered_once(view, state, thin_rays, parameters), *(Color(0) for _ in SETS)],
        [],
    )
    entry = _entry(view, state, rays)
    suns = _suns(view, parameters)
    for number, sun in enumerate(suns):
        # The collectors of the last frame, where a search starts with them.
        last_collectors = view.carried[number] if view.carried is not None else None
        orders = _many_times(
            view, state, thin_rays, entry, sun, last=last_collectors, parameters=parameters
        )
        by_set[1:] = [
            sum_ + view.lights[sun].intensity * part
            for sum_, part in zip(by_set[1:], orders.by_set)
        ]
        collectors.append(orders.collectors)
    for number, light in enumerate(view.lights):
        # The light of a uniform sky comes by orders as well, without a search.
        if state.escapes is not None and number not in suns:
            of_sky = sky_light(
                state.escapes, light, rays, view.visible if view.features.shadows else None
            )
            by_set = [sum_ + part for sum_, part in zip(by_set, of_sky)]
    # Clouds are as opaque as their full density makes them, with the peak.
    opacity = parameters.opacity_along(rays, state.stride)
    layers = _with_opacity(view, state, rays, sum(by_set), opacity)
    extra = dict(zip(ORDER_LAYERS, by_set)) | {OPACITY: opacity} if view.extra_layers else None
    return replace(layers, extra=extra, carried=tuple(collectors) if parameters.carries else None)


def _suns(view: View, parameters: CloudCollectors) -> list[int]:
    """Return the numbers of the lights that shine from one direction."""
    assert view.medium.clouds is not None
    return beams_of(view.lights, parameters.sky, view.medium.clouds)


def _rays(view: View, state: CloudState) -> tuple[CloudRays, CloudRays]:
    """Return camera rays through clouds as dense as they are, and
    through those without the peak.
    """
    assert view.medium.clouds is not None
    clouds = view.medium.clouds
    thin = _without_peak(clouds, state)
    # One walk finds both depths: the channels without the peak come behind the full ones.
    joined = replace(clouds, sigma_t=(*clouds.sigma_t, *thin.sigma_t))
    rays = cloud_rays(
        state.surfaces, joined, view.origin, view.direction, view.distance, stride=state.stride
    )
    channels = len(clouds.sigma_t)
    thin_rays = replace(rays, clouds=thin, depths=rays.depths[channels:])
    return replace(rays, clouds=clouds, depths=rays.depths[:channels]), thin_rays


def _entry(view: View, state: CloudState, rays: CloudRays) -> _Entry:
    """Return where camera rays meet a cloud."""
    clouds = view.medium.clouds
    assert clouds is not None
    # A cloud with densities is met where the density passes the threshold, others at their
    # boundary. A camera in a cloud, whose first boundary is a way out, is itself the point.
    if clouds.density is not None:
        met = dense_surface(
            state.surfaces,
            clouds,
            view.origin,
            view.direction,
            view.distance,
            threshold=state.threshold,
            stride=state.stride,
        )
        hit = dr.isfinite(met.distance)
        return _Entry(
            view.origin + view.direction * dr.select(hit, met.distance, 0), met.cloud, hit
        )
    first = rays.first
    begin = dr.select(first.leaves, 0, first.distance)
    hit = dr.isfinite(begin) & (begin < view.distance)
    return _Entry(view.origin + view.direction * dr.select(hit, begin, 0), first.cloud, hit)


def _scattered_once(
    view: View, state: CloudState, thin_rays: CloudRays, parameters: CloudCollectors
) -> Any:
    """Return order 1, a colour [W/(m^2 sr)]."""
    beams = [_beam(view, state, thin_rays.clouds, number) for number in _suns(view, parameters)]
    once = parameters.light_once(thin_rays, beams, state.stride)
    return sum((radiance for (radiance,) in once), type(view.medium.albedo)(0))


def _with_opacity(
    view: View, state: CloudState, rays: CloudRays, in_scattered: Any, opacity: Any
) -> Layers:
    """Return layers with what is seen behind clouds."""
    return Layers(
        in_scattered,
        tuple(
            light_on_surfaces(
                rays, segment_through(state.surfaces, rays.clouds, light, stride=state.stride)
            )
            for light in view.lights
        ),
        1 - opacity,
        sky_behind(view.lights, view.distance, type(view.medium.albedo)),
    )


def _without_peak(clouds: Clouds, state: CloudState) -> Clouds:
    """Return clouds without the peak of their phase functions, which scatter once as
    much as those with it (TMS).
    """
    # With the density (1 - a f) sigma_t and the albedo a/(1 - a f), their product, and with it the
    # light scattered once, is the cloud's; only the way through is less dense. A grey cloud has one
    # channel.
    channels = range(len(state.extinction_factor))
    sigma_t = tuple(
        clouds.sigma_t[min(c, len(clouds.sigma_t) - 1)] * state.extinction_factor[c]
        for c in channels
    )
    albedo = [
        value / state.extinction_factor[min(c, channels[-1])]
        for c, value in enumerate(clouds.albedo)
    ]
    return replace(clouds, sigma_t=sigma_t, albedo=type(clouds.albedo)(*albedo))


def _beam(view: View, state: CloudState, clouds: Clouds, number: int) -> Beam:
    """Return a sun as points in clouds see it that scatter once."""
    light, sun = view.lights[number], state.maps[number]
    Float = type(view.distance)
    assert sun is not None
    # Lengths through each cloud along the light: from its maps, or where it has densities its
    # depths.
    maps = [sun.of_cloud(mi.UInt32(cloud)) for cloud in range(dr.width(clouds.phase))]
    lengths: list[Any] = [partial(length_along_light, of_cloud) for of_cloud in maps]
    if state.depths:
        lengths = [of_cloud.at for of_cloud in state.depths[number]]
    segment = segment_by_lengths(clouds, lengths)
    lit = (lambda point, active: view.visible(point, light)) if view.features.shadows else None
    cosine = -dr.dot(view.direction, light.axis)
    return Beam(
        light.intensity,
        (Float(1),),
        (tuple(phase.evaluate(cosine) for phase in clouds.phases),),
        segment,
        lit,
    )


def _many_times(
    view: View,
    state: CloudState,
    rays: CloudRays,
    entry: _Entry,
    sun: int,
    *,
    last: Any,
    parameters: Any,
) -> OrdersLight:
    """Return the light of the sun of a number that was scattered twice and more,
    for unit irradiance [1/sr].

    Its sets are colours; `collectors` are by channel and filling what the
    next frame takes as `last`.
    """
    Float, Color = type(view.distance), type(view.medium.albedo)
    # Each channel and filling has a search, masked to the rays that meet a cloud with that filling.
    search = Search(
        parameters.iterations,
        parameters.along_light,
        # Where a density stays below the threshold the map has no cloud, but
        # light passes there, too.
        covered=state.body is None,
    )
    of_sun = state.maps[sun]
    assert of_sun is not None
    sums: list[Any] = []
    collectors: list[Any] = []
    for channel, extinction in enumerate(rays.clouds.sigma_t):
        # The slab has the mean density of the cloud's body.
        if state.body is not None:
            extinction = extinction * state.body
        sigma_t = dr.gather(Float, extinction, entry.cloud, entry.hit)
        of_fillings: list[Any] = []
        of_channel: list[Any] = []
        for filling in state.fillings:
            own_clouds = filling.clouds[channel]
            if own_clouds is None:  # no search is recorded for an albedo that other channels have
                continue
            filled = entry.hit & (dr.gather(mi.UInt32, own_clouds, entry.cloud, entry.hit) != 0)
            light = light_of_orders(
                of_sun.of_cloud(entry.cloud),
                filling.transport,
                sets=len(SETS),
                point=entry.point,
                toward=-view.direction,
                # 1 stands for the extinction of lanes without the filling.
                extinction=dr.select(filled, sigma_t, 1),
                behind=rays.depths[channel],
                search=search,
                last=None if last is None else last[channel][len(of_channel)],
                active=filled,
            )
            # Other clouds and opaque shapes shade the collector of each set by itself.
            lit = [
                _reaching(view, of_sun, extinction, entry, sun, collector)
                for collector in light.collectors
            ]
            of_fillings.append(
                tuple(radiance * fraction for radiance, fraction in zip(light.by_set, lit))
            )
            of_channel.append(light.collectors)
        collectors.append(tuple(of_channel))
        # No filling, and no light, in a channel in which no cloud scatters.
        none = dr.zeros(Float, dr.width(view.distance))
        sums.append([sum((by_set[n] for by_set in of_fillings), none) for n in range(len(SETS))])
    # A grey scene has one channel, which stands for all three.
    by_set = tuple(Color(*parts) for parts in zip(*(sums * (3 // len(sums)))))
    return OrdersLight(by_set, tuple(collectors))


def _reaching(
    view: View, of_sun: LightMap, sigma_t: Any, entry: _Entry, sun: int, collector: Collector
) -> Any:
    """Return the fraction of a sun's light that other clouds and opaque shapes
    leave to a collector [1].

    `sigma_t` is the extinction of each cloud, one channel [1/m].
    """
    Float, clouds = type(view.distance), dr.width(sigma_t)
    centre, fraction = entry.point + collector.centre, Float(1)

    def behind(number, fraction):
        # Another cloud attenuates the part of the collector's width that lies in its shade, over
        # the mean length there; the collector's own cloud does not shade it.
        cover, length = shade(of_sun.of_cloud(number), centre, collector.width)
        attenuated = 1 - cover * (1 - dr.exp(-dr.gather(Float, sigma_t, number) * length))
        return number + 1, dr.select(number == entry.cloud, fraction, fraction * attenuated)

    if clouds > 1:
        lanes = dr.width(centre)
        _, fraction = dr.while_loop(
            state=(dr.zeros(mi.UInt32, lanes), dr.full(Float, 1, lanes)),
            cond=lambda number, fraction: number < clouds,
            body=behind,
            labels=("number", "fraction"),
        )
    if view.features.shadows:
        fraction = dr.select(view.visible(centre, view.lights[sun]), fraction, 0)
    return fraction
