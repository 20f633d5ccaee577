# SPDX-License-Identifier: BSD-3-Clause
"""The door for media: a density that grows with height says what it is, and the sums are right for lamps and suns."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import quad

from reference.quadrature.adaptive_panels import sum_pieces
from reference.quadrature.fields import Field
from reference.quadrature.pieces import Pieces, cut, whole
from reference.quadrature.unbounded import TERMS
from reference.visibility.planes import Rays, rays_at

LEAST, RATE, TOP = 0.13, 0.21, 6.0  # extinction at height 0 [1/m], its growth [1/m^2], and where it ends [m]


def depth_between(z0, z1, length):
    """Return the optical depth of a straight line between two heights below the top, by the mean density."""
    return (LEAST + 0.5 * RATE * (z0 + z1)) * length


@dataclass(frozen=True)
class _Growing:
    """sigma_t = LEAST + RATE z, albedo 1, isotropic."""

    rays: Rays
    pieces: Pieces

    def __post_init__(self):
        ones = np.ones((len(self.pieces.ray), 3))
        object.__setattr__(self, "factor", ones)
        object.__setattr__(self, "extinction", (LEAST + RATE * TOP) * ones[:, 0])
        object.__setattr__(self, "same", np.zeros(3, np.int64))

    def __call__(self, rows, x, inside, r, scatter):
        ray = self.pieces.ray[rows]
        z0, rise = self.rays.origin[2], self.rays.direction[ray, 2][:, None]
        z, light = z0 + x * rise, self.rays.position[ray, 2][:, None]
        shadow = depth_between(z, light, r) if self.rays.w else depth_between(z, TOP, (TOP - z) / light)
        depth = depth_between(z0, z, x) + shadow
        return ((LEAST + RATE * z) * np.exp(-depth))[:, :, None], depth[:, :, None]


class GrowingFog:
    strongest = np.full(3, LEAST + RATE * TOP)

    def optical_depth(self, origin, direction, low, high):
        z0, z1 = (origin[..., 2] + end * direction[:, 2] for end in (low, high))
        return np.repeat(depth_between(z0, z1, np.maximum(high - low, 0.0))[:, None], 3, axis=1)

    def leave(self, origin, direction):
        return np.where(direction[:, 2] > 0, (TOP - origin[2]) / direction[:, 2], np.inf)

    def sums(self, rays, stretches, distance, terms=TERMS):
        pieces = cut(whole(stretches), (np.array([0, 1]), np.array([1.3, 2.1])))  # anywhere: nothing may change
        terms = replace(terms, rtol=terms.rtol or 1e-10)
        value, error = sum_pieces(rays, pieces, _Growing(rays, pieces), slice(0, len(rays.foot)), terms)
        return value / (4 * np.pi), error / (4 * np.pi)


@pytest.mark.parametrize("w", [1, 0])
def test_a_medium_that_varies_comes_through_the_door(w):
    field: Field = GrowingFog()
    direction = np.array([[0.6, 0.0, 0.8], [0.0, 0.8, 0.6], [0.8, 0.6, 0.0]])
    light = np.array([1.3, 0.7, 3.1])
    position = light if w else light / np.linalg.norm(light)
    rays = rays_at(np.array([0.0, 0.1, 0.3]), direction, position, w)
    stretches = np.array([0, 1, 1, 2]), np.array([0.4, 0.0, 2.0, 0.7]), np.array([3.9, 1.1, 4.0, 5.0])
    value, bound = field.sums(rays, stretches, np.full(3, 6.0))
    expected = np.zeros(3)
    for ray, low, high in zip(*stretches, strict=True):

        def integrand(x, way=direction[ray]):
            point = rays.origin + x * way
            if w:
                r = np.linalg.norm(light - point)
                end, spread = light[2], r * r
            else:
                end, spread = TOP, 1.0
                r = (TOP - point[2]) / position[2]
            depth = depth_between(rays.origin[2], point[2], x) + depth_between(point[2], end, r)
            return (LEAST + RATE * point[2]) * np.exp(-depth) / spread / (4 * np.pi)

        expected[ray] += quad(integrand, low, high, epsabs=0, epsrel=1e-12, limit=200)[0]
    assert value == pytest.approx(np.repeat(expected[:, None], 3, axis=1), rel=1e-9)
    assert np.all(np.abs(value[:, 0] - expected) <= bound[:, 0] + 1e-12 * expected)
