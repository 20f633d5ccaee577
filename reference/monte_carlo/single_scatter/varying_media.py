# SPDX-License-Identifier: BSD-3-Clause
r"""Camera rays in media whose extinction differs from place to place: height fog and density grids.

**Height fog.** Mitsuba's plugin says the density, antiderivatives the optical depths. With an
antiderivative G of the density over the height, constant beyond floor and cap, the optical depth of
a segment of length l between two heights is l (G(z_1) - G(z_0))/(z_1 - z_0), and up to a sun at the
height mu it is (G(cap) - G(z))/mu. A sky shines from below too: then it is (G(z) - G(floor))/|mu|.
For a layer

    G(z) = -sigma_i H_i exp(-(z - z_i)/H_i),     clamped below z_i:  sigma_i (z - z_i - H_i).

If both heights are nearly equal, the depth is the density between them times l. (The quadrature
takes the lower end and (1 - e^-u)/u.) A free flight has the density sigma exp(-tau)/(1 -
exp(-tau_end)): tau is inverted by bisection. Under a sun every sample is a free flight: the
estimate is the transmittance of its path, and bounded. Under a light at a place one half of the
samples are equi-angular (`reference.monte_carlo.single_scatter.distance_sampling`).

**Density grids.** Transmittances are unbiased estimates by ratio tracking with Mitsuba's own
majorant m (Novak, Selle, Jarosz 2014): the product of 1 - sigma_t/m over the points of a Poisson
process of the density m. They use no cell of the grid and no optical depth. Distances are
even under suns and skies, between the ends of the box, and under lights at places a mixture of even
and equi-angular ones. Integrands are bounded: over the angle at a place by twice sigma_t T_1 T_2 p
height, under a sun by sigma_t T_1 T_2 p.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import (
    Path,
    Surroundings,
    unblocked,
)
from airlight.reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    equi_angular,
    equi_angular_pdf,
)
from airlight.reference.monte_carlo.single_scatter.stretches import (
    Distances,
    Part,
    Ray,
    Transmittance,
)
from airlight.reference.scene.varying import HeightMedium, VaryingMedium


def varying_part(
    medium: VaryingMedium, around: Surroundings, ray: Ray, distance: "mi.Float | mi.Float64"
) -> "FogPart | GridPart":
    """Return the part of camera rays in a medium, up to the surface at a distance [m]."""
    plugin = mi.MediumPtr(medium.plugin)
    if isinstance(medium, HeightMedium):
        up = mi.Vector3d(*medium.up.tolist())
        height, rise = dr.dot(ray.origin_double, up), dr.dot(ray.direction_double, up)
        ends = [(z - height) / rise for z in (medium.floor, medium.cap)]
        # The ray is in the fog between its passages through floor and cap. A level ray is in the
        # fog everywhere or nowhere, and is followed up to `farthest` [m].
        farthest = 1e6
        level, inside = rise == 0, (height >= medium.floor) & (height <= medium.cap)
        first = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
        last = dr.select(
            level, dr.select(inside, farthest, 0), dr.clip(dr.maximum(*ends), 0, farthest)
        )
        last = dr.minimum(last, mi.Float64(distance))
        return FogPart(around, first, last, plugin, last > first, medium, up, height, rise)
    meets, near, far = plugin.intersect_aabb(mi.Ray3f(ray.origin, ray.direction))
    start, end = mi.Float64(dr.maximum(near, 0)), mi.Float64(dr.minimum(far, distance))
    majorant = float(dr.max(medium.plugin.get_majorant(dr.zeros(mi.MediumInteraction3f)))[0])
    return GridPart(around, start, end, plugin, meets & (end > start), majorant)


@dataclass(frozen=True)
class FogPart(Part):
    """Camera rays in height fog."""

    fog: HeightMedium
    up: "mi.Vector3d"  #: unit: heights are along it
    height: "mi.Float64"  #: of the camera [m]
    rise: "mi.Float64"  #: vertical component of the directions

    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample free flights; for a light at a place one half of the distances by the angle at the
        light; see `Part`.
        """
        u = mi.Float64(u)
        before = self._depth_to(low)
        # The probability that a flight ends in the stretch.
        probability = 1 - dr.exp(before - self._depth_to(low + length))
        # Half of u draws free flights, half draws angles at the light; each half is stretched to 0
        # to 1.
        v = u if span is None else dr.select(u < 0.5, 2 * u, 2 * u - 1)
        depth = before - dr.log(1 - v * probability)

        def halve(number, below, above):
            middle = 0.5 * (below + above)
            short = self._depth_to(middle) < depth
            return number + 1, dr.select(short, middle, below), dr.select(short, above, middle)

        # The depth grows along the ray: 48 bisections find where the flight ends, to 2^-48 of the
        # stretch.
        state = (mi.UInt32(0), mi.Float64(low), mi.Float64(low + length))
        bracket = dr.while_loop(
            state, lambda number, *_: number < 48, halve, label="inverse of the depth"
        )
        y = 0.5 * (bracket[1] + bracket[2]) - low
        if span is not None:
            y = dr.select(u < 0.5, equi_angular(v, span), y)
        # The density of free flights, and of both techniques together.
        x = low + y
        transmittance = dr.exp(before - self._depth_to(x))
        pdf = self._density(self.height + self.rise * x) * transmittance / probability
        flights = dr.select(probability > 0, pdf, 0)
        return y, flights if span is None else 0.5 * (flights + equi_angular_pdf(y, span))

    def transmittance(
        self,
        x: "mi.Float64",
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance of both ways; see `Part`."""
        depth = self._light_depth(point, path)
        transmittance = mi.Spectrum(mi.Float(dr.exp(-self._depth_to(x) - depth)))
        return dr.select(unblocked(self.around, *path.ray, active), transmittance, 0), sampler

    def _light_depth(self, point: "mi.Interaction3f", path: Path) -> "mi.Float64":
        """Return the optical depth from the light along paths to points."""
        z = dr.dot(mi.Vector3d(point.p), self.up)
        if path.far:
            return self._depth_beyond(z, dr.dot(mi.Vector3d(path.away), self.up))
        begin = dr.dot(mi.Vector3d(path.begin), self.up)
        return self._depth(z, begin, mi.Float64(path.length))

    def _depth_to(self, x: "mi.Float64") -> "mi.Float64":
        """Return the optical depth from the camera to distances x [m]."""
        return self._depth(self.height, self.height + self.rise * x, x)

    def _depth(self, z0: "mi.Float64", z1: "mi.Float64", length: "mi.Float64") -> "mi.Float64":
        """Return optical depths between two heights, a length apart [m]."""
        fog = self.fog
        least = min((scale for _, _, scale in fog.layers), default=1.0)
        # Heights that differ by less than 1e-5 of the least scale height count as equal.
        level = dr.abs(z1 - z0) < 1e-5 * least
        rise = dr.select(level, 1, z1 - z0)
        middle = 0.5 * (z0 + z1)
        inside = (middle >= fog.floor) & (middle <= fog.cap)
        on_level = dr.select(inside, length * self._density(middle), 0)
        return dr.select(
            level, on_level, length * (self._antiderivative(z1) - self._antiderivative(z0)) / rise
        )

    def _depth_beyond(self, z: "mi.Float64", rise: "mi.Float64") -> "mi.Float64":
        """Return the optical depth from heights [m] out of the fog; `rise`: the vertical component
        of the directions.
        """
        at_height = self._antiderivative(z)
        above, below = (
            self._antiderivative(mi.Float64(end)) for end in (self.fog.cap, self.fog.floor)
        )
        return dr.select(rise > 0, above - at_height, at_height - below) / dr.maximum(
            dr.abs(rise), 1e-30
        )

    def _antiderivative(self, z: "mi.Float64") -> "mi.Float64":
        """Return G at heights [m]."""
        z = dr.clip(z, self.fog.floor, self.fog.cap)
        total = self.fog.constant * z
        for sigma_t, base, scale in self.fog.layers:
            over = z - base
            # Below z_i a clamped layer has its full density: G is linear there, and continuous at
            # z_i.
            decayed = -scale * dr.exp(-(dr.maximum(over, 0) if self.fog.clamped else over) / scale)
            total += sigma_t * (
                dr.select(over < 0, over - scale, decayed) if self.fog.clamped else decayed
            )
        return total

    def _density(self, z: "mi.Float64") -> "mi.Float64":
        """Return the extinction at heights between floor and cap [1/m]."""
        total = mi.Float64(self.fog.constant)
        for sigma_t, base, scale in self.fog.layers:
            over = z - base
            total += sigma_t * dr.exp(-(dr.maximum(over, 0) if self.fog.clamped else over) / scale)
        return total


@dataclass(frozen=True)
class GridPart(Part):
    """Camera rays in the box of a grid."""

    majorant: float  #: Mitsuba's bound of the extinction [1/m]
    estimated = True

    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample distances evenly, for a light at a place one half of them by the angle at it; see
        `Part`.
        """
        u = mi.Float64(u)
        if span is None:
            return u * length, 1 / length
        # A ray may meet the light in an empty voxel: the angle is a step there. Half of the samples
        # have it; one distribution function of both, as in `sample_distance`, is not inverted there.
        y = dr.select(u < 0.5, equi_angular(2 * u, span), (2 * u - 1) * length)
        return y, 0.5 * (1 / length + equi_angular_pdf(y, span))

    def transmittance(
        self,
        x: "mi.Float64",
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return estimates of the transmittance of both ways; see `Part`."""
        camera, sampler = self._tracked((ray.origin, ray.direction, mi.Float(x)), sampler, active)
        light, sampler = self._tracked(path.ray, sampler, active)
        return dr.select(
            unblocked(self.around, *path.ray, active), mi.Spectrum(camera * light), 0
        ), sampler

    def _tracked(
        self,
        line: "tuple[mi.Point3f, mi.Vector3f, mi.Float]",
        sampler: "mi.Sampler",
        active: "mi.Bool",
        *,
        fraction: "mi.Float | float" = 1.0,
    ) -> "tuple[mi.Float, mi.Sampler]":
        """Return estimates of the transmittance along lines, given by origin [m], unit direction
        and length [m], through a fraction of the optical depth, and the sampler.
        """
        origin, direction, distance = line
        meets, near, far = self.medium.intersect_aabb(mi.Ray3f(origin, direction))
        begin, end = dr.maximum(near, 0), dr.minimum(far, distance)

        def fly(x, transmittance, sampler):
            # The next point of the Poisson process of the density m; the product of 1 - sigma_t/m
            # over its points is the estimate. A process of a fraction of m has that of the depth.
            x = x - dr.log(1 - sampler.next_1d()) / (self.majorant * fraction)
            place = dr.zeros(mi.MediumInteraction3f)
            place.p = origin + direction * x
            _, _, sigma_t = self.medium.get_scattering_coefficients(place, x < end)
            return (
                x,
                dr.select(x < end, transmittance * (1 - sigma_t[0] / self.majorant), transmittance),
                sampler,
            )

        # Lanes that miss the box start behind their end, and take no step.
        start = dr.select(active & meets, begin, dr.inf)
        state = start, dr.full(mi.Float, 1, dr.width(start)), sampler
        _, transmittance, sampler = dr.while_loop(
            state, lambda x, *_: x < end, fly, label="ratio tracking"
        )
        return transmittance, sampler
