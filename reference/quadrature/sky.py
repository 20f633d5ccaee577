# SPDX-License-Identifier: BSD-3-Clause
r"""The light of a uniform sky: a sum of suns, each exact in the media and behind what stands in it.

A sky of the radiance Ls shines from all directions w'. Along a camera ray w

    L = int_0^d  exp(-tau(o, x)) sigma_s(x)  1/(4 pi) int p(w . w') V(x, w') exp(-tau(x, w')) Ls dw'  dx
      = int  K(w')  Ls dw',

where K(w') is what the ray receives of a directional light of irradiance 1 from w': the integrals
change places, and every K is exact (`reference.quadrature.light_airlight`): lit intervals by
geometry, height fog in closed form, pieces of bounded media with an error that is added up.
Surfaces have f cos in the place of the phase function. One integral remains, over the sphere of
directions. It is taken by a lattice of directions, even in the solid angle, in eight replicates
whose spread is its standard error (`reference.quadrature.replicates`). K is smooth in w' where
nothing stands in the light and bounds have no edges; an edge costs digits, and no pixel is without
an error.

Two cases follow:

- In an unbounded medium of extinction above 0 the sky is infinitely far and tau(x, w') is infinite.
  No light of the sky arrives: the scattered light is 0, and so is the sky seen through the medium.
  Such a scene has no sky (`ReferenceScene.sky`).
- In height fog the paths from directions at and below the horizon end at the floor of the fog.
  Without a floor they would be infinitely deep. Under an isotropic phase function the light
  scattered at a height z, with the column C above and B below it, is Ls (E_2(C) + E_2(B))/2, E_2
  the exponential integral: it checks the sum.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import optical_depth
from airlight.reference.quadrature.light_airlight import light_airlight
from airlight.reference.quadrature.replicates import REPLICATES, PointPlan, square_points
from airlight.reference.quadrature.surface import UNBOUNDED, Reflection, SurfaceHits
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import Shapes

Array = NDArray[np.float64]
Fraction = Callable[[float], None]


@dataclass(frozen=True)
class SkyLight:
    """The light of a sky, by replicate."""

    replicates: Array  #: airlight and surface, (rays, 6, replicates) [W/(m^2 sr)]
    error: Array  #: the error of its suns, not of their number, (rays, 3) [W/(m^2 sr)]


def sky_light(
    reference: ReferenceScene,
    hits: SurfaceHits,
    *,
    shapes: Shapes,
    plan: PointPlan,
    tell: Fraction = lambda fraction: None,
) -> SkyLight:
    """Compute what a uniform sky adds to airlight and surfaces along every ray.

    `reference`: the scene, which has a sky; `hits`: what its rays hit; `shapes`: what can stand in
    the light; `plan`: the most directions of a replicate, its seed, and whether surfaces get the
    light; `tell`: called with the fraction of the work that is done.
    """
    assert reference.sky is not None
    # A replicate has at most 64 directions, each a sun for all rays.
    count, most = len(hits.distance), min(plan.most, 64)
    replicates, error = np.zeros((count, 6, REPLICATES)), np.zeros((count, 3))
    visible = np.flatnonzero(np.isfinite(hits.distance)) if plan.surfaces else np.empty(0, np.int64)
    point = reference.origin + hits.distance[visible, None] * reference.direction[visible]
    start = np.zeros(len(visible))
    # The light from surfaces to the camera is attenuated by the same fraction under every sun.
    transmittance = np.exp(
        -optical_depth(
            reference, reference.origin, reference.direction[visible], start, hits.distance[visible]
        )
    )
    reflection = Reflection(hits.interaction)
    for replicate in range(REPLICATES):
        # The sky counts as light 2^20: its lattices are not the lattices of other lights.
        square = square_points(PointPlan(most=most, seed=plan.seed), 1 << 20, replicate, "sphere")
        for number, direction in enumerate(_directions(square)):
            # A sun stands for the solid angle 4 pi / most of the sky: its irradiance is Ls times
            # that.
            sun = DirectionalLight(direction, reference.sky * 4 * np.pi / most, None)
            received = light_airlight(reference, sun, hits.distance, shapes=shapes, checks=0)
            replicates[:, :3, replicate] += received.radiance
            # Errors of the suns of a replicate add up; the error of the mean is their mean over
            # replicates.
            error += received.error / REPLICATES
            # Surfaces that this sun reaches: f cos, attenuated to the sun and to the camera.
            lit = received.reached[visible]
            row, towards = visible[lit], np.broadcast_to(-direction, (int(lit.sum()), 3))
            if len(row):
                through = optical_depth(
                    reference, point[lit], towards, start[lit], np.full(len(row), UNBOUNDED)
                )
                reflected = reflection(row, towards) * np.exp(-through)
                radiance = reflected * transmittance[lit] * sun.irradiance
                replicates[row, 3:, replicate] += radiance
            tell((replicate + (number + 1) / most) / REPLICATES)
    return SkyLight(replicates, error)


def _directions(square: Array) -> Array:
    """Return the directions in which the suns shine, unit vectors, even in
    the solid angle, (n, 3).
    """
    height, azimuth = 1 - 2 * square[:, 0], 2 * np.pi * square[:, 1]
    across = np.sqrt(np.maximum(1 - height**2, 0.0))
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), height], axis=1)
