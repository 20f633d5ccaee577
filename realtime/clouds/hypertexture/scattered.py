# SPDX-License-Identifier: BSD-3-Clause
r"""Light that was scattered once in clouds with densities, and their opacity as printed.

The sum of `realtime.clouds.single_scattering` with the extinction kappa rho of each step, and the legs of the
light linear on it. Nodes lie at

    tau_k = -s log(1 - (k/N) (1 - exp(-T/s)))

as there, T the depth that a ray had if the density were 1 everywhere: from a node at the depth tau to the next it is at
most -s log(1 - exp(tau/s) (1 - exp(-T/s))/N) at full density, so that a cloud of one density has the nodes of a
homogeneous one. No step is longer than those of `realtime.clouds.hypertexture.march`, which see the voxels.

Printed (Bouthors 2008, eqs 1 and 2) are e_{i+1} - e_i for the light of a step, and for its opacity the same over kappa
rho, with exp(-kappa_i rho_i x): the local extinction times the whole distance since the first cloud.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr

from realtime.clouds.bounds import CloudSurfaces, optical_depths, sum_over_stretches
from realtime.clouds.hypertexture.march import OPAQUE, least, march, marched_depths, middle_density, voxel
from realtime.clouds.single_scattering import (
    SPREAD,
    Beam,
    CloudRays,
    finished,
    reaching,
    scattered,
    with_step,
)
from realtime.scene.media.bounded import Clouds


def with_densities(rays: CloudRays, stride: Any) -> CloudRays:
    """Return rays with their depths by the densities of clouds, where they have any."""
    if rays.clouds.density is None:
        return rays
    depths = marched_depths(rays.surfaces, rays.clouds, rays.origin, rays.direction, rays.end, stride=stride, seen=True)
    return replace(rays, depths=depths)


def light_once(
    rays: CloudRays, beams: Sequence[Beam], *, steps: int, stride: Any, printed: bool = False
) -> tuple[tuple[Any, ...], ...]:
    """Return the radiance that clouds with or without densities scatter once, see `marched_light`."""
    if rays.clouds.density is None:
        return scattered(rays, beams, steps=steps, printed=printed)
    return marched_light(rays, beams, steps=steps, stride=stride, printed=printed)


def opacity_as_printed(surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end, *, stride: Any) -> Any:
    """Return what is printed for the opacity of clouds with or without densities, a colour [m]; see `marched_depths`.

    Bouthors, Neyret, Max, Bruneton, Crassin 2008, eq. 2.
    """
    Float, Color, lanes = type(direction.x), type(clouds.albedo), dr.width(direction)
    dense = clouds.density is not None

    def add(total, begin, finish, cloud, inside):
        first, sums = total
        rho = middle_density(clouds, origin, direction, begin, finish, cloud, inside) if dense else 1
        kappas = [dr.gather(Float, sigma_t, cloud, inside) * rho for sigma_t in clouds.sigma_t]
        first = dr.select(inside & ~dr.isfinite(first), begin, first)
        near, far = (dr.select(inside, place - first, 0) for place in (begin, finish))
        terms = [
            dr.select(inside & (kappa > 0), (dr.exp(-kappa * far) - dr.exp(-kappa * near)) / kappa, 0)
            for kappa in kappas
        ]
        return first, tuple(own + term for own, term in zip(sums, terms))

    nothing = dr.full(Float, dr.inf, lanes), tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    if dense:
        _, sums = march(
            surfaces,
            origin,
            direction,
            end,
            nothing,
            step=lambda total, x, cloud, inside: stride * voxel(clouds, cloud, inside),
            add=lambda total, begin, finish, cloud, inside: (add(total, begin, finish, cloud, inside), inside),
        )
    else:
        _, sums = sum_over_stretches(surfaces, origin, direction, end, nothing, add)
    return Color(*(sums * (3 // len(sums))))


def marched_light(
    rays: CloudRays, beams: Sequence[Beam], *, steps: int, stride: Any, printed: bool = False
) -> tuple[tuple[Any, ...], ...]:
    """Return the radiance that clouds scatter once into rays, by beam and octave, RGB [W/(m^2 sr)].

    `rays`, `beams`, `steps`, `printed`: as for `realtime.clouds.single_scattering.scattered`; the longest step
    where a ray enters [voxels].

    Bouthors, Neyret, Max, Bruneton, Crassin 2008, sections 6.2 and 8.
    """
    clouds, Float, Color = rays.clouds, type(rays.direction.x), type(rays.clouds.albedo)
    channels, lanes = len(clouds.sigma_t), dr.width(rays.direction)
    bound = optical_depths(rays.surfaces, clouds, rays.origin, rays.direction, rays.end)
    share = (1 - dr.exp(-sum(bound) / (channels * SPREAD))) / steps

    def step(total, x, cloud, inside):
        _, depths, *_ = total
        tau = sum(depths) / channels
        kappa = sum(dr.gather(Float, own, cloud, inside) for own in clouds.sigma_t) / channels
        growth = dr.exp(dr.minimum(tau, OPAQUE) / SPREAD)
        left = 1 - share * growth
        node = dr.select(left > 0, -SPREAD * dr.log(dr.maximum(left, 1e-30)) / kappa, dr.inf)
        return dr.minimum(node, stride * voxel(clouds, cloud, inside) * growth)

    def add(total, begin, end, cloud, inside):
        last, depths, legs, lit, sums = total
        # Where a stretch begins, so do the legs.
        first_legs, first_lit = reaching(rays, beams, begin, inside & (begin != last))
        fresh = begin != last
        legs = tuple(
            tuple(dr.select(fresh, new, old) for new, old in zip(*pair)) for pair in zip(first_legs, legs, strict=True)
        )
        lit = tuple(dr.select(fresh, new, old) for new, old in zip(first_lit, lit, strict=True))
        next_legs, next_lit = reaching(rays, beams, end, inside)
        rho = middle_density(clouds, rays.origin, rays.direction, begin, end, cloud, inside)
        length = dr.select(inside, rho * (end - begin), 0)
        own = tuple(dr.gather(Float, sigma_t, cloud, inside) * length for sigma_t in clouds.sigma_t)
        after = tuple(depth + part for depth, part in zip(depths, own))
        shown = tuple(0.5 * (old + new) for old, new in zip(lit, next_lit))
        sums = with_step(
            clouds, beams, sums, own, (depths, after), (legs, next_legs), shown, cloud, inside, printed=printed
        )
        legs = tuple(
            tuple(dr.select(inside, new, old) for new, old in zip(*pair)) for pair in zip(next_legs, legs, strict=True)
        )
        lit = tuple(dr.select(inside, new, old) for new, old in zip(next_lit, lit, strict=True))
        return (dr.select(inside, end, last), after, legs, lit, sums), least(after) < OPAQUE

    total = (
        dr.full(Float, -1, lanes),
        tuple(dr.zeros(Float, lanes) for _ in range(channels)),
        tuple(tuple(dr.zeros(Float, lanes) for _ in range(channels)) for _ in beams),
        tuple(dr.zeros(Float, lanes) for _ in beams),
        tuple(tuple(dr.zeros(Color, lanes) for _ in beam.scales) for beam in beams),
    )
    *_, sums = march(rays.surfaces, rays.origin, rays.direction, rays.end, total, step=step, add=add)
    return finished(clouds, beams, sums)
