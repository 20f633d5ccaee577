# SPDX-License-Identifier: BSD-3-Clause
r"""Clouds by collectors as Bouthors 2008 has them, also with its equations as they are printed.

Slabs are as thick as the cloud is along the light (`thickness=light`), the density is half
(`peak=half`), and a sky is a beam from above (`sky=beams`). Two equations can be had as printed.
The mean slopes of light maps, the cover of collectors and the depth behind points are those of
`cloud-collectors`.

**The opacity of clouds along a ray**, eq. 2, with the extinctions kappa_i of
the stretches in clouds:

    opacity = sum (exp(-kappa_i x_{i+1}) - exp(-kappa_i x_i)) / kappa_i.

The sign of the sum is wrong: the sum integrates exp(-kappa x), which falls. The sum is a length,
since the factor kappa is missing, and each exponent has the local kappa times the whole distance
instead of the depth cumulated up to there. As printed the opacity is negative, and more light comes
out than went in; x is counted from where the ray enters the first cloud. In a grid kappa is taken
in the middle of a step.

**Single scattering**, eq. 1: the light of a step between two nodes is e_{i+1} - e_i, with e =
exp(-u) and u the depth of both segments. The other sign and the factor kappa dx/(kappa dx + dl)
would be right (`realtime.clouds.single_scattering`).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.clouds.march import march, middle_density, voxel
from airlight.realtime.clouds.single_scattering import CloudRays, light_once
from airlight.realtime.methods.cloud_collectors import CloudCollectors
from airlight.realtime.parameters import parameter


@dataclass(frozen=True)
class CloudCollectors2008(CloudCollectors):
    """The light of clouds along every ray, by order of scattering, as published.

    Its slabs are too thick, its density too low, and light is negative where
    single scattering is printed.

    References
    ----------
    Bouthors, Neyret, Max, Bruneton, Crassin 2008, *Interactive multiple
    anisotropic scattering in clouds*.
    """

    name = "cloud-collectors-2008"
    summary = "cloud-collectors as published, also with equations 1 and 2 as printed"
    as_published = ""

    thickness: str = parameter(
        "light",
        "thickness of slabs along the light, or across their faces",
        choices=("light", "slab"),
    )
    peak: str = parameter(
        "half",
        "cut the peak below 5 degrees and lower the density by half, or to match; or keep the peak",
        choices=("half", "matched", "full"),
    )
    single: str = parameter(
        "corrected",
        "single scattering as derived, or by eq. 1 as printed",
        choices=("corrected", "printed"),
    )
    opacity: str = parameter(
        "corrected", "opacity as derived, or by eq. 2 as printed", choices=("corrected", "printed")
    )
    sky: str = parameter(
        "beams",
        "the light of a sky: a beam from above of pi times its radiance, or the same from "
        "everywhere",
        choices=("beams", "uniform"),
    )

    @property
    def along_light(self):
        """Whether thickness and depth in slabs are counted along the light."""
        return self.thickness == "light"

    def cut(self, phase, types):
        """Return the fraction of the light of a phase function that is cut from its peak [1]."""
        # Half of the density is left, as printed.
        return 0.5 if self.peak == "half" else super().cut(phase, types)

    def light_once(self, rays, beams, stride):
        """Return the radiance that clouds scatter once into rays, by beam and
        octave, RGB [W/(m^2 sr)].
        """
        if self.single == "corrected":
            return super().light_once(rays, beams, stride)
        return light_once(rays, beams, steps=self.steps, stride=stride, integral=printed_step)

    def opacity_along(self, rays, stride):
        """Return the opacity of clouds along rays, a colour."""
        return (
            super().opacity_along(rays, stride)
            if self.opacity == "corrected"
            else printed_opacity(rays, stride)
        )


def printed_step(depth: Any, eye: tuple[Any, Any], segment: tuple[Any, Any]) -> Any:
    """Return eq. 1 of a step, from the depths to the `eye` and of the `segment` at its ends."""
    # e_{i+1} - e_i: it should be the other way round, and is therefore negative in a cloud.
    return dr.exp(-(eye[1] + segment[1])) - dr.exp(-(eye[0] + segment[0]))


def printed_opacity(rays: CloudRays, stride: Any) -> Any:
    """Return eq. 2 along rays through clouds, a colour [m]; `stride`
    [voxels] as of `light_once`.
    """
    clouds, origin, direction = rays.clouds, rays.origin, rays.direction
    Float, Color, lanes = type(direction.x), type(clouds.albedo), dr.width(direction)

    # The sum carries the distance at which the ray enters the first cloud, from which x counts.
    def add(total, begin, finish, inside, cloud):
        first, sums = total
        rho = middle_density(clouds, origin, direction, begin, finish, cloud)
        kappas = [dr.gather(Float, sigma_t, cloud) * rho for sigma_t in clouds.sigma_t]
        first = dr.minimum(first, begin)
        near, far = begin - first, finish - first
        # A step in vacuum adds nothing, and would divide by 0.
        terms = [
            dr.select(kappa > 0, (dr.exp(-kappa * far) - dr.exp(-kappa * near)) / kappa, 0)
            for kappa in kappas
        ]
        return (first, tuple(so_far + term for so_far, term in zip(sums, terms))), mi.Bool(True)

    def step(total, x, cloud):
        return stride * voxel(clouds, cloud)

    nothing = dr.full(Float, dr.inf, lanes), tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    _, sums = march(rays.surfaces, origin, direction, rays.end, nothing, step=step, add=add)
    # A grey medium has one sum for all three channels.
    return Color(*(sums * (3 // len(sums))))
