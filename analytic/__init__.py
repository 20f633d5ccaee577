# SPDX-License-Identifier: BSD-3-Clause
"""The airlight equation in float64 and in as many digits as wanted: the side of truth, which imports nothing of ours.

- `analytic.phase`: phase functions of mean 1 over the sphere;
- `analytic.geometry`: foot and height of a ray over a light, and the changes of variables x, theta, q, w;
- `analytic.integral`: the airlight integral of one segment in three forms, derived, by adaptive quadrature;
- `analytic.certified`: the same to 15 digits and more, by two quadratures in mpmath that must agree;
- `analytic.panels`: the same for millions of segments, in NumPy, each with its error estimate;
- `analytic.series`: the power series behind the polynomial of Biri 2006;
- `analytic.cases`: tables of cases in CSV files.

Names and units are those of DESIGN section 2: lengths in metres, extinction in 1/m, J in 1/m.
"""

from analytic.cases import Cases, integrate_cases, read_cases
from analytic.certified import integrate_certified, isotropic_closed_form
from analytic.errors import InputError
from analytic.geometry import foot_and_height, path_length
from analytic.integral import Estimate, integrate_angle, integrate_distance, integrate_path
from analytic.panels import airlight_segments
from analytic.phase import PHASE_NAMES, PhaseFunction
from analytic.series import taylor_coefficients

__all__ = [
    "PHASE_NAMES",
    "Cases",
    "Estimate",
    "InputError",
    "PhaseFunction",
    "airlight_segments",
    "foot_and_height",
    "integrate_angle",
    "integrate_cases",
    "integrate_certified",
    "integrate_distance",
    "integrate_path",
    "isotropic_closed_form",
    "path_length",
    "read_cases",
    "taylor_coefficients",
]
