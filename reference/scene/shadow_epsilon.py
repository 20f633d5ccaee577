# SPDX-License-Identifier: BSD-3-Clause
r"""How far short of the light Mitsuba's shadow rays end.

A shadow ray must not hit the light's own surface, so `Interaction.spawn_ray_to` ends it a relative
`ShadowEpsilon` early (Mitsuba 3.9, `include/mitsuba/render/interaction.h`). volpath attenuates over
that shorter length too, so its light arrives too bright by the factor exp(sigma_t r epsilon). In
single precision epsilon is 15 000 roundings of 2^-24, 8.94e-4. Later versions of Mitsuba have
another rule, so it is measured, never assumed.
"""

import drjit as dr
import mitsuba as mi
import numpy as np


def measure_shadow_epsilon() -> float:
    """Return the relative shortening epsilon of shadow rays in the active Mitsuba variant [1].

    The ray from a point in the medium to a light at distance r has the length (1 - epsilon) r.
    """
    # A point of the medium has no surface normal, so its position is not offset and only the
    # shortening is left. One power of two times an axis: position, direction and length are exact,
    # and so is the quotient.
    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(0, 0, 0)
    distance = 2.0
    ray = interaction.spawn_ray_to(mi.Point3f(0, 0, distance))
    return 1.0 - float(np.ravel(np.asarray(ray.maxt))[0]) / distance
