# SPDX-License-Identifier: BSD-3-Clause
"""The rows of the other papers of the documentation: misprints, kernels and a peer that are built here."""

from validation.fidelity.figures import at, ratio
from validation.fidelity.row import AtMost, Bound, Row

ROWS: tuple[Row, ...] = (
    Row(
        "sun",
        "3, dimensionless",
        "the airlight integral depends on dimensionless parameters only: times h, relative difference",
        Bound(1e-12),
        "equations",
        at("scaling"),
        AtMost("an identity: what is left is rounding in double precision"),
    ),
    Row(
        "pegoraro",
        "closed form",
        "an analytical solution in homogeneous media: median relative error on moderate rays, double precision",
        Bound(1e-10),
        "polynomials",
        at("moderate", "closed-form", "median"),
        AtMost("an analytical solution is exact but for rounding"),
        command="airlight stability --kernels closed-form",
    ),
    Row(
        "chen",
        "min/max trees",
        "the tree finds the lit segments of the map: error of a walk for every pixel over that of the light volume",
        Bound(1.5),
        "slices",
        ratio(at("pixel", "relative_rmse"), at("volume", "relative_rmse")),
        AtMost(
            "both read the same map, the tree a second time along its slices; half as much again is allowed for that"
        ),
        unit="times",
    ),
    Row(
        "chen",
        "epipolar sampling",
        "few samples along epipolar lines are enough: error of interpolated samples over that of every pixel",
        Bound(2),
        "slices",
        ratio(at("samples", "relative_rmse"), at("pixel", "relative_rmse")),
        AtMost("enough is read as twice the error at most, in `colonnade`"),
        unit="times",
    ),
)
