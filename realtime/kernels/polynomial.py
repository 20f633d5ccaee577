# SPDX-License-Identifier: BSD-3-Clause
"""A Chebyshev polynomial of the airlight integrand, fitted to each ray's own range and integrated in closed form.

Biri 2006 expands the integrand about the foot point in the angle theta, which serves near that point only. A polynomial
serves a whole range if it interpolates at the Chebyshev points of that range, and converges fast if the integrand's
singularities lie far from the range in the chosen variable. With E = q/h (DESIGN section 2) and a = sigma_t h,

    J = (2/h) int_{E0}^{E1} exp(-sigma_t (foot + h E)) p / (1 + E^2) dE,     (1 + cos)/2 = 1/(1 + E^2).

Of the integrand, exp(-a E) is entire, 1/(1 + E^2) has poles at E = +-i, and Henyey-Greenstein has branch points at E =
+-i and +-i d, d = (1 - g)/(1 + g). The variable w of E = m sinh w, with m = min(1, d), has them all on the lines |Im w|
= pi/2, whatever the lobe (sinh(u + i pi/2) = i cosh u covers i [1, inf)). "Hazy" and "murky" have no singularity but E
= +-i; there m is about the width of the lobe. With the offset u from the near end, 0 <= u <= U, J is a factor times the
integral of f(u) (`realtime.kernels.polynomial_piece`). The polynomial through n = degree + 1 values of f at the
Chebyshev points y_j = cos(pi (2j + 1)/(2n)), y = 2u/U - 1, has the integral sum_j (weight_j f_j) over the whole range,
with fixed positive weights: the polynomial kernel **is** Fejer's first quadrature rule, and is computed so.

**Rate.** Interpolation of degree N and Fejer's rule converge at least as rho^-N, rho = |z + sqrt(z^2 - 1)| > 1 at the
singularity nearest in this sense, z = (w - w0)/(U/2) - 1 (Trefethen 2013, theorems 8.2 and 19.3). Gauss's rule with as
many nodes has rho^-2N; as is known (Trefethen 2008), Fejer's keeps up with it to a fair accuracy: on the certified
cases, g up to 0.98, 16 nodes have the 99 % errors 3e-5 (Gauss 2e-6) for isotropic, 3e-4 (9e-4) for Rayleigh and 7e-4
(7e-4) for Henyey-Greenstein media; 32 nodes have 1e-9, 9e-7, 5e-7 (3e-10, 3e-9, 2e-7). A tabulated phase function has
kinks: there both are of second order.

References
----------
Trefethen 2008, *Is Gauss quadrature better than Clenshaw-Curtis?*, SIAM Review 50. Trefethen 2013, *Approximation
Theory and Approximation Practice*.
"""

import math
from functools import lru_cache

from realtime.errors import InputError
from realtime.kernels.polynomial_piece import integrand, piece_of, with_limits
from realtime.rays.ray_light import RayGeometry, smooth_subsegments
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, per_extinction


def polynomial(geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, degree: int = 15):
    """Return the airlight integral J by a Chebyshev polynomial fitted to each segment [1/m].

    Parameters
    ----------
    geometry, x0, x1, medium, light
        See `realtime.kernels`.
    degree
        Degree of the polynomial, 0 or more; degree + 1 values of the integrand are taken.

    Raises
    ------
    InputError
        For a negative degree.

    Notes
    -----
    Valid for any ray, extinction (vacuum included) and phase function, any segment, endless ones included: 0 for one of
    no length, also with the light beside it on the ray (height 0); +inf where the light lies on the segment. Soft spots
    are fitted in three pieces, the falloff as a part of the integrand. Errors and their rate: see the module.
    """
    nodes = _nodes(degree)

    def integral(sigma_t):
        total = 0
        for begin, end in smooth_subsegments(geometry, light, x0, x1):
            piece = piece_of(geometry, begin, end, sigma_t, medium.phase)
            weighted = sum(
                w * integrand(piece, (0.5 + 0.5 * y) * piece.width, geometry, medium, light) for y, w in nodes
            )
            total += with_limits(piece, begin, end, piece.factor * piece.width * (0.5 * weighted))
        return total

    return per_extinction(medium, integral)


@lru_cache
def _nodes(degree: int) -> tuple[tuple[float, float], ...]:
    """Return the Chebyshev points of the first kind with the weights of Fejer's first rule."""
    if degree < 0:
        raise InputError(f"degree: got {degree}, wanted 0 or more")
    n = degree + 1
    nodes = []
    for j in range(n):
        angle = math.pi * (2 * j + 1) / (2 * n)
        total = sum(math.cos(2 * k * angle) / (4 * k * k - 1) for k in range(1, n // 2 + 1))
        nodes.append((math.cos(angle), (2 - 4 * total) / n))
    return tuple(nodes)
