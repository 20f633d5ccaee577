# SPDX-License-Identifier: BSD-3-Clause
"""Media in the quadrature: the one interface, `Field`.

All other code uses a field: the sums over lit intervals, surfaces, and lights that the camera sees.
A new medium is a class with the members of `Field` in its own file, and a line in `field_of`. Where
its integrals have no closed form, `sums` says where the corners of the medium are and how much
light it scatters between them, an `Integrand` for some stretches, and `sum_stretches` of
`reference.quadrature.integrate` does the rest: lights, tolerances and edges.
`reference.quadrature.density_grid` is an example.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.density_grid import GridField
from airlight.reference.quadrature.height_fog import HeightField
from airlight.reference.quadrature.homogeneous import HomogeneousField
from airlight.reference.quadrature.integrate import TERMS, ErrorKind, Terms
from airlight.reference.quadrature.intervals import Stretches
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import GridMedium, HeightMedium
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]


class Field(Protocol):
    """The interface of a medium, or of all media of a scene together."""

    @property
    def error_kind(self) -> ErrorKind:
        """The kind of the errors of `sums`."""

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, albedo sigma_t p, (3,) [1/m]."""

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1], 0 where high <= low.

        `origin` is (n, 3), or (3,) for all; `direction` has unit vectors, (n, 3); distances are
        (n,) [m], and may be as large as floats are.
        """

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance behind which rays meet nothing that scatters,
        (n,) [m]; may be infinite.
        """

    def sums(
        self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS
    ) -> tuple[Array, Array]:
        """Return the airlight of each ray from its lit stretches, and its error by
        `error_kind`, (rays, 3) each.

        `rays`: in their planes with lights of strength 1: places if `rays.w` is 1 [1/m^2], else
        directions [1/sr]; `stretches`: rays, and distances of both ends; the second may be infinite
        [m]; `distance`: of each ray to the visible surface [m]; `terms`: how the lights shine, and
        what is uncertain.
        """


def field_of(reference: ReferenceScene) -> Field:
    """Return the field of a scene."""
    if isinstance(reference.medium, HeightMedium):
        return HeightField(reference.medium)
    if isinstance(reference.medium, GridMedium):
        return GridField(reference.medium)
    return HomogeneousField(reference)


def optical_depth(
    reference: ReferenceScene, origin: Array, direction: Array, low: Array, high: Array
) -> Array:
    """Return the optical depth of parts of straight lines in a scene; see `Field.optical_depth`."""
    return field_of(reference).optical_depth(origin, direction, low, high)
