# SPDX-License-Identifier: BSD-3-Clause
r"""Light paths from the eye through clouds, in one loop that casts one ray a turn.

A path flies an exponentially distributed optical length through clouds (air has no extinction), is
scattered by the phase function, and so on until it leaves and meets the sky. At every place of
scattering a shadow ray to a sun adds the sun's light: one of the suns at random, by its irradiance.

With a directional sun that term holds the phase function p_s of the angle between the path and the
sun, whose forward peak is rarely met and then large. Directions are therefore sampled a second
time, about the sun (multiple importance sampling, Veach and Guibas 1995): from each place x a *side
flight* leaves in a direction drawn from p_s, has its own free flight, and adds the sun's light
where the flight ends. With p_a the phase function about the path, the sun's light at the ends of
both flights counts

    p_a/(p_a + p_s)                  times its value after the path's own flight,

which is at most 1 times p_s, so that their product stays below p_a: no peak is left. A place before
which the path was not scattered (the first, and the one after a surface) has no side flight before
it, and its light counts whole.

Paths are never cut short in clouds: absorption is a weight. Where a weight falls below 0.05, by
absorption or by dark surfaces, the path goes on with a probability in proportion (Russian roulette,
unbiased). A shadow ray that leaves a cloud with less than 1/8 of its light likewise goes on with 8
times that fraction as its probability.

The end of a stretch names its medium. A stretch that ends at a face of a cloud seen from inside is
in the cloud. One that ends at a face seen from outside, or has no end, is in vacuum. One that ends
at an opaque surface is in the medium that the last crossing named. A crossing that rounding doubles
or hides therefore does no harm beyond the next face. After a crossing a ray starts a little further
on; this gap is added to the length of its next stretch.

A cloud with a density has its largest extinction for `sigma_t`, and the fraction rho of it at each
place. Flights go as if the extinction was the largest everywhere; where a flight ends, the path is
scattered with the probability rho, and otherwise flies on (delta tracking, Woodcock 1965). A shadow
ray has such flights too, and goes on with the factor 1 - rho where one ends (ratio tracking, Novak,
Selle, Jarosz 2014), or by the roulette above. Each flight casts the ray of its turn again.

A lane of the loop follows the samples of one pixel one after another, so that lanes end
at nearly the same time.
"""

from dataclasses import dataclass
from functools import partial

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.cloud_paths.tables import WalkScene

MAIN, SIDE, SHADOW, SIDE_SHADOW, SURFACE_SHADOW = range(5)  #: what the ray of a lane is


@dataclass(frozen=True)
class Targets:
    """Where light goes: its layer by order of scattering, and two of surfaces.

    Light that met no surface goes to one of `orders` layers, or to the layer `orders` if its order
    belongs to none of them. Two layers follow: light that met a surface and was scattered too, or
    met several surfaces; and light that came straight from the lights to the visible surface and
    from there to the eye.
    """

    #: layer of each order from 0 on; the last entry stands for all further orders
    by_order: "mi.UInt32"
    orders: int  #: how many layers of orders there are

    @property
    def count(self) -> int:
        """How many layers there are."""
        return self.orders + 3

    def layer(self, order: "mi.UInt32", met: "mi.Bool", straight: "mi.Bool") -> "mi.UInt32":
        """Return the layer of light of an order; `met`: whether it met a surface, `straight`:
        whether it was not scattered either.
        """
        of_order = dr.gather(
            mi.UInt32, self.by_order, dr.minimum(order, dr.width(self.by_order) - 1)
        )
        of_surface = dr.select(straight, mi.UInt32(self.orders + 2), mi.UInt32(self.orders + 1))
        return dr.select(met, of_surface, of_order)


@dataclass
class Paths:
    """The state of a lane's path."""

    mode: "mi.UInt32"  #: what its ray is, `MAIN` to `SURFACE_SHADOW`
    o: "mi.Point3f"  #: where the ray starts [m]
    d: "mi.Vector3f"  #: its unit direction
    gap: "mi.Float"  #: how far past the last crossing it starts [m]
    #: optical length that remains of a flight, or that a shadow ray has passed
    depth: "mi.Float"
    #: number of the medium where the ray starts, for stretches that end at an opaque surface
    medium: "mi.UInt32"
    x: "mi.Point3f"  #: the last place of scattering or reflection [m]
    w: "mi.Vector3f"  #: unit direction in which the path came there, or leaves a surface
    cloud: "mi.UInt32"  #: number of the medium of that place
    weight: "mi.Color3f"  #: of the path
    order: "mi.UInt32"  #: how many times it was scattered
    bounces: "mi.UInt32"  #: how many surfaces it met
    fraction: "mi.Float"  #: of the sun's light that counts at the end of this flight
    value: "mi.Color3f"  #: radiance at the start of a shadow ray [W/(m^2 sr)]
    target: "mi.UInt32"  #: the layer to which this radiance goes
    remaining: "mi.UInt32"  #: how many paths the lane has to follow, this one among them


def walk(
    scene: WalkScene,
    targets: Targets,
    sampler: "mi.Sampler",
    rays: "mi.Ray3f",
    *,
    samples: int,
    side: float,
) -> "list[mi.Float]":
    """Return the sums over samples, (layers x lanes) for each channel.

    `scene`: the scene as tables; `targets`: the layer of each order; `sampler`: seeded, as wide as
    there are lanes; `rays`: where paths start at the eye, and their unit directions, one a lane;
    `samples`: how many paths each lane follows; `side`: probability of a side flight, 0 to 1.
    """
    lanes = dr.width(rays.d)
    sums = [dr.zeros(mi.Float, targets.count * lanes) for _ in range(3)]
    paths = Paths(
        mode=mi.UInt32(MAIN),
        o=mi.Point3f(rays.o),
        d=mi.Vector3f(rays.d),
        gap=mi.Float(0),
        depth=-dr.log(1 - sampler.next_1d()),
        medium=mi.UInt32(scene.camera_medium),
        x=mi.Point3f(0),
        w=mi.Vector3f(0, 0, 1),
        cloud=mi.UInt32(0),
        weight=mi.Color3f(1),
        order=mi.UInt32(0),
        bounces=mi.UInt32(0),
        fraction=mi.Float(1),
        value=mi.Color3f(0),
        target=mi.UInt32(0),
        remaining=mi.UInt32(samples),
    )
    # A lane starts with its first path: a flight of random length from the eye. The loop ends when
    # all lanes have followed all of their paths.
    turn = partial(_turn, scene=scene, targets=targets, sums=sums, rays=rays, side=side)
    dr.while_loop(
        state=(paths, sampler),
        cond=lambda paths, _: paths.remaining > 0,
        body=turn,
        label="paths through clouds",
    )
    return sums


def _counted_fraction(of_path: "mi.Float", of_suns: "mi.Float", side: float) -> "mi.Float":
    """Return p_a/(p_a + side p_s); 0 where both are 0, as at the end of a table that u = 0 draws."""
    return of_path / dr.maximum(of_path + side * of_suns, dr.smallest(mi.Float))


def _turn(
    paths: Paths,
    sampler: "mi.Sampler",
    *,
    scene: WalkScene,
    targets: Targets,
    sums: "list[mi.Float]",
    rays: "mi.Ray3f",
    side: float,
) -> "tuple[Paths, mi.Sampler]":
    """Cast the ray of every lane, add the light that arrives, and return the state of the paths
    with their next rays.
    """
    active = paths.remaining > 0
    lanes = dr.width(rays.d)
    lane = dr.arange(mi.UInt32, lanes)
    flags = int(mi.RayFlags.All) if scene.has_surfaces else int(mi.RayFlags.Minimal)
    mode, o, d, gap, depth, medium = (
        paths.mode,
        paths.o,
        paths.d,
        paths.gap,
        paths.depth,
        paths.medium,
    )
    x, w, cloud, weight, order = paths.x, paths.w, paths.cloud, paths.weight, paths.order
    bounces, fraction, value, target = paths.bounces, paths.fraction, paths.value, paths.target
    si = scene.scene.ray_intersect(mi.Ray3f(o, d), flags, False, active)
    hit = active & si.is_valid()
    kind = dr.gather(mi.UInt32, scene.kinds, dr.reinterpret_array(mi.UInt32, si.shape), hit)
    opaque, boundary = hit & (kind == 0), hit & (kind > 0)
    # The medium of the stretch by its end: a face seen from inside is left, and the cloud was
    # around; before an opaque surface the medium is the one where the path was last.
    leaves = boundary & (dr.dot(si.n, d) > 0)
    within = dr.select(leaves, kind, dr.select(opaque, medium, 0))
    sigma_t = dr.gather(mi.Float, scene.sigma_t, within, active)
    optical = dr.select(within > 0, sigma_t * (si.t + gap), 0.0)
    # The modes up to `SIDE` are flights, the others shadow rays. A flight whose length is used up
    # within the stretch ends in its medium.
    flies, is_main = active & (mode <= SIDE), active & (mode == MAIN)
    scatters = flies & (within > 0) & (optical > depth)
    crosses, meets = boundary & ~scatters, opaque & ~scatters
    escapes = active & ~hit
    scattered_at = o + d * (depth / dr.maximum(sigma_t, dr.smallest(mi.Float)) - gap)
    shadow = active & ~flies
    stays = thins = mi.Bool(False)
    if scene.densities:
        # Delta and ratio tracking in clouds with a density: a shadow ray takes a new free length on
        # each stretch. Where a flight or a free length ends, rho is looked up: a flight goes on
        # with the probability 1 - rho, a shadow ray with the factor 1 - rho.
        uneven, free = scene.uneven(within), -dr.log(1 - sampler.next_1d(active))
        thins = shadow & uneven & (free < optical)
        place = o + d * (free / dr.maximum(sigma_t, dr.smallest(mi.Float)) - gap)
        scattered_at = dr.select(thins, place, scattered_at)
        rho = scene.density(within, scattered_at, scatters | thins)
        stays = thins | (scatters & (sampler.next_1d(active) >= rho))
        scatters &= ~stays
        crosses, meets, leaves = crosses & ~thins, meets & ~thins, leaves & ~thins
        optical = dr.select(
            thins, -dr.log(dr.maximum(1 - rho, 0)), dr.select(shadow & uneven, 0, optical)
        )
    begins = scatters & is_main
    # A shadow ray adds up its depth; a flight has the less length left.
    depth = dr.select(shadow, depth + optical, depth - optical)

    # Shadow rays add their light, or end at a surface, or by roulette where they leave a cloud.
    lit = dr.exp(-dr.select(shadow, depth, 0.0))
    arrives, dims = shadow & escapes, shadow & (leaves | thins)
    arriving = value * lit
    place = target * lanes + lane
    for number in range(3):
        dr.scatter_add(
            sums[number], arriving[number], place, arrives, mode=dr.ReduceMode.NoConflicts
        )
    # A shadow ray with less than 1/8 of its light goes on with 8 times its fraction as probability.
    chance = dr.minimum(8.0 * lit, 1.0)
    fades = dims & (sampler.next_1d(active) >= chance)
    value = dr.select(dims, arriving / dr.maximum(chance, dr.smallest(mi.Float)), value)
    depth = dr.select(dims, 0.0, depth)
    dark = arrives | fades | (shadow & meets)
    crosses &= ~fades

    # The path is scattered, or reflected by a surface, or has left.
    albedo = dr.gather(mi.Color3f, scene.albedo, within, active)
    order = dr.select(begins, order + 1, order)
    weight = dr.select(begins, weight * albedo, weight)
    x, w, cloud = (
        dr.select(begins, scattered_at, x),
        dr.select(begins, d, w),
        dr.select(begins, within, cloud),
    )
    over = escapes & is_main
    if scene.has_sky:
        # The sky that the eye sees directly belongs to no layer. Light of the sky that only one
        # surface sent on is `straight`.
        of_sky = over & ((order > 0) | (bounces > 0))
        place = targets.layer(order, bounces > 0, (order == 0) & (bounces == 1)) * lanes + lane
        from_sky = weight * mi.Color3f(*scene.sky)
        for number in range(3):
            dr.scatter_add(
                sums[number], from_sky[number], place, of_sky, mode=dr.ReduceMode.NoConflicts
            )
    sun = scene.random_sun(sampler, active)
    to_sun, irradiance = scene.to_sun(sun), scene.irradiance(sun)
    # At the end of a flight the light of a sun counts by the phase function about the direction of
    # that flight. A side flight is one more scattering that the path itself does not make: it takes
    # its albedo here, and its order is one more.
    weighed = dr.select(begins, weight, weight * albedo) * fraction
    scattered = weighed * scene.phase_value(within, d, to_sun, scatters) * irradiance
    value = dr.select(scatters, scattered, value)
    of_order = dr.select(begins, order, order + 1)
    target = dr.select(scatters, targets.layer(of_order, bounces > 0, mi.Bool(False)), target)
    shadow_from, reflects = mi.Point3f(scattered_at), mi.Bool(False)
    if scene.has_surfaces:
        # Only the path is reflected; a side flight that meets a surface ends there. The material
        # says what a sun sends from here, and where the path goes on.
        reflects = meets & is_main
        bounces = dr.select(reflects, bounces + 1, bounces)
        bsdf, context = si.bsdf(mi.RayDifferential3f(mi.Ray3f(o, d))), mi.BSDFContext()
        reflected_sun = bsdf.eval(context, si, si.to_local(to_sun), reflects) * irradiance
        value = dr.select(reflects, weight * reflected_sun, value)
        target = dr.select(
            reflects, targets.layer(order, mi.Bool(True), (order == 0) & (bounces == 1)), target
        )
        first, second = (
            sampler.next_1d(active),
            mi.Point2f(sampler.next_1d(active), sampler.next_1d(active)),
        )
        bsdf_sample, reflectance = bsdf.sample(context, si, first, second, reflects)
        onwards = si.to_world(bsdf_sample.wo)
        weight = dr.select(reflects, weight * reflectance, weight)
        w, x = dr.select(reflects, onwards, w), dr.select(reflects, si.spawn_ray(onwards).o, x)
        cloud = dr.select(reflects, medium, cloud)
        shadow_from = dr.select(reflects, si.spawn_ray(to_sun).o, shadow_from)

    # The next ray: a shadow ray, a side flight, the path itself, or the next path.
    begins_shadow = (scatters | reflects) & scene.has_suns
    # The order at a place of scattering: shadow ray, then perhaps a side flight with its own shadow
    # ray, then the path goes on. After a surface the path goes on in the direction that was drawn
    # there. Without suns there are no shadow rays to wait for.
    reflected = (dark & (mode == SURFACE_SHADOW)) if scene.has_suns else reflects
    main_done = (dark & (mode == SHADOW)) if scene.has_suns else begins
    turns_aside = main_done & (sampler.next_1d(active) < side)
    side_done = ((mode == SIDE) & active & (escapes | meets)) | (dark & (mode == SIDE_SHADOW))
    resumes = side_done | (main_done & ~turns_aside)
    # A side flight is drawn about a sun, the path about its own direction, both by the phase
    # function of the place. p_a and p_s of the derivation give the fraction with which the next sun
    # light counts.
    about = dr.select(turns_aside, scene.to_sun(scene.random_sun(sampler, active)), w)
    new = scene.scattered(cloud, about, sampler, resumes | turns_aside)
    of_path = scene.phase_value(cloud, w, new, resumes | turns_aside)
    of_suns = scene.phase_about_suns(cloud, new, resumes | turns_aside)
    fraction = dr.select(resumes | turns_aside, _counted_fraction(of_path, of_suns, side), fraction)
    fraction = dr.select(reflected, 1.0, fraction)

    # Russian roulette below a weight of 0.05: the weight of a path falls by absorption and at
    # surfaces alone.
    survival = dr.minimum(dr.max(weight) / 0.05, 1.0)
    resumes_any = resumes | reflected
    lost = resumes_any & (sampler.next_1d(active) >= survival)
    weight = dr.select(resumes_any, weight / dr.maximum(survival, dr.smallest(mi.Float)), weight)
    over |= lost

    # A flight that begins, or that goes on after a delta collision, has a new length; a shadow ray
    # begins with no depth.
    flown = resumes_any | turns_aside | over
    free = -dr.log(1 - sampler.next_1d(active))
    depth = dr.select(flown | (stays & flies), free, dr.select(begins_shadow, 0.0, depth))
    forward = scene.beyond
    # The start of the next ray; later lines override earlier ones: behind a crossing, at a delta
    # collision, a shadow ray, a flight, the next path from the eye. Direction, medium and mode
    # follow in the same order.
    next_o = dr.select(crosses, o + d * (si.t + forward), o)
    next_o = dr.select(stays, scattered_at, next_o)
    next_o = dr.select(begins_shadow, shadow_from, next_o)
    next_o = dr.select(resumes_any | turns_aside, x, next_o)
    o = dr.select(over, rays.o, next_o)
    next_d = dr.select(begins_shadow, to_sun, d)
    next_d = dr.select(resumes | turns_aside, new, next_d)
    next_d = dr.select(reflected, w, next_d)
    d = dr.select(over, rays.d, next_d)
    gap = dr.select(crosses, forward, dr.select(flown | begins_shadow | stays, 0.0, gap))
    next_medium = dr.select(crosses, dr.select(leaves, 0, kind), medium)
    next_medium = dr.select(scatters | stays, within, next_medium)
    next_medium = dr.select(resumes_any | turns_aside, cloud, next_medium)
    medium = dr.select(over, scene.camera_medium, next_medium)
    next_mode = dr.select(begins_shadow, dr.select(reflects, SURFACE_SHADOW, mode + 2), mode)
    next_mode = dr.select(turns_aside, SIDE, next_mode)
    mode = dr.select(resumes_any | over, MAIN, next_mode)
    weight = dr.select(over, 1.0, weight)
    order, bounces = dr.select(over, 0, order), dr.select(over, 0, bounces)
    fraction = dr.select(over, 1.0, fraction)
    following = Paths(
        mode,
        o,
        d,
        gap,
        depth,
        medium,
        x,
        w,
        cloud,
        weight,
        order,
        bounces,
        fraction,
        value,
        target,
        remaining=dr.select(over, paths.remaining - 1, paths.remaining),
    )
    return following, sampler
