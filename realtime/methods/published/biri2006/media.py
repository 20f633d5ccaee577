# SPDX-License-Identifier: BSD-3-Clause
"""Bounded media with a constant distance from the light, section 4.2 of Biri 2006.

The paper puts a constant R for r in the exponent, and takes the distance x_n at which the ray
enters from x. As printed it is

    L = k_t exp(-k_t (r + R - x_n)) Omega/(4 pi h)
        int I exp(-k_t R (sin theta + 1)/cos theta) p dtheta,

which cannot be meant: r before the integral is a variable of it, and the exponent within it counts
R once more and lets h go. The exponent x - x_n + R with x = t + h tan theta gives

    L = k_t exp(-k_t (t + R - x_n)) Omega/(4 pi h) int I exp(-k_t h tan theta) p dtheta.

That is ``media=paper``. ``media=printed`` is the first equation with t for the r before the
integral, which alone can be meant, and the exponent within it as it stands. A kernel may have a
polynomial for either (`realtime.methods.published.biri2006.polynomial`); without one they are
summed over the panels of `realtime.scene.media.bounded_rays`. The paper treats each medium alone:
the light reaches a body through vacuum, however many bodies are before it. The transmittance
between the body and the camera is one factor for a ray; it is applied here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.kernels.registry import Kernel
from airlight.realtime.methods.interface.method import View
from airlight.realtime.methods.published.biri2006.polynomial import ConstantLeg, polynomial_of
from airlight.realtime.numerics.array_types import chosen_value
from airlight.realtime.numerics.functions import summed
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded_rays import BoundedRays, Piece, camera_pieces

FORMS = ("exact", "paper", "printed")  #: of the depth of bounded media


@dataclass(frozen=True)
class ConstantRays(BoundedRays):
    """Rays in bounded media and one light, with the constant R for the distance from the light."""

    printed: bool = False  #: whether the exponent is the printed one
    #: of the kernel, in the place of panels; see `bounded_taylor`
    polynomial: Callable[..., Any] | None = None

    def integral(self, piece, x0, x1):
        """Return albedo sigma J over a segment [m] in one piece, a colour [1/m^2]."""
        return (
            super().integral(piece, x0, x1)
            if self.polynomial is None
            else self.continued(piece, x0, x1)
        )

    def light_paths(self, piece, x0, x1):
        """Return no paths: R is the length of all of them."""
        return []

    def growth(self, piece, x, r):
        """Return how fast the exponent grows along the ray [1/m]."""
        rate = super().growth(piece, x, r)
        if not self.printed:
            return rate
        # The derivative of R (r + s)/h along the ray is R (1 + s/r)/h.
        s = x - self.geometry.foot
        return rate * (1 + self._distance(piece) * (1 + s / r) / self.height)

    def depths(self, piece, x, r, lengths):
        """Return the exponents with the constant R for the light's path, by channel."""
        # The part of the exponent that is the same at all x: the depth before the medium, and
        # sigma_t (R - x_n).
        distance = self._distance(piece)
        constants = [
            before + sigma * (distance - piece.begin)
            for before, sigma in zip(piece.before, piece.medium.sigma_t)
        ]
        # As meant, the exponent grows with x alone.
        if not self.printed:
            return [
                dr.fma(sigma, x, constant)
                for sigma, constant in zip(piece.medium.sigma_t, constants)
            ]
        # As printed, R (sin theta + 1)/cos theta takes the place of x - t, where t is the foot: by
        # the form of (r + s)/h that does not cancel.
        s, h = x - self.geometry.foot, self.height
        ratio = dr.select(s > 0, (r + s) / h, h / (r - s))
        depth = dr.fma(distance, ratio, self.geometry.foot)
        return [
            dr.fma(sigma, depth, constant)
            for sigma, constant in zip(piece.medium.sigma_t, constants)
        ]

    def continued(self, piece: Piece, x0, x1):
        """Return albedo sigma J over a segment by the polynomial, a colour [1/m^2].

        The segment may lie before the medium: there the exponent is continued, as section 4.2 does
        that begins all integrals at the camera.
        """
        distance, polynomial = self._distance(piece), self.polynomial
        assert polynomial is not None

        # Each channel has an exponent, and so a polynomial.
        def integral(x0, x1):
            channels = []
            for before, sigma in zip(piece.before, piece.medium.sigma_t):
                depth = dr.fma(sigma, distance - piece.begin, before)
                segment = ConstantLeg(sigma, depth, distance, self.printed)
                channels.append(
                    sigma
                    * polynomial(self.geometry, x0, x1, self.light, piece.medium.phase, segment)
                )
            return piece.medium.albedo * type(self.medium.albedo)(*channels)

        segments = self.geometry.smooth_subsegments(self.light, x0, x1)
        if len(segments) == 1:
            return integral(x0, x1)
        # A loop: the integral is long, and its code need not be there for each segment.
        return summed(
            len(segments),
            lambda number: integral(
                *(chosen_value(ends, number) for ends in zip(*segments, strict=True))
            ),
            self.nothing(dr.width(self.geometry.height, x0, x1)),
        )

    def _distance(self, piece: Piece):
        """Return R [m]."""
        return self.medium.bounded_media[piece.number].mean_distance


def constant_rays(view: View, light: Light, kernel: Kernel | None, form: str) -> ConstantRays:
    """Return the rays of a view with one light in bounded media, by the form 'paper' or 'printed'.

    Raises
    ------
    InputError
        For a medium around the bounded ones, a light at infinity, and what the polynomial refuses.
    """
    medium, geometry = view.medium, view.geometry(light)
    if not medium.clear:
        raise InputError(f"media={form}: needs vacuum around the bounded media; use media=exact")
    if not light.w:
        raise InputError(
            f"media={form}: the published approximation is of lights with a place; use media=exact"
        )
    printed, polynomial = form == "printed", polynomial_of(kernel)
    if polynomial is not None:
        # A polynomial must refuse here, not in a branch. Dr.Jit computes no
        # value that nobody reads.
        zero = type(geometry.height)(0)
        for bounded in medium.bounded_media:
            segment = ConstantLeg(bounded.medium.sigma_t[0], zero, bounded.mean_distance, printed)
            polynomial(geometry, zero, zero, light, bounded.medium.phase, segment)
    pieces = camera_pieces(medium, view)
    return ConstantRays(medium, light, view, geometry, kernel, pieces, printed, polynomial)


def gamma_in(rays: BoundedRays, x):
    """Return the integral from where the rays enter their one piece up to the distance x [m],
    which may lie beyond the piece, RGB [1/m^2].
    """
    # Panels may begin at the camera: before the piece they find no medium.
    if not isinstance(rays, ConstantRays) or rays.polynomial is None:
        return rays.airlight(type(x)(0), x)
    (piece,) = rays.pieces
    return rays.continued(
        piece, *rays.geometry.lit_segment(piece.begin, dr.maximum(x, piece.begin))
    )
