# SPDX-License-Identifier: BSD-3-Clause
"""The droplets of Bouthors 2008 by Mie's theory: what the paper says of them, measured at 0.55 um."""

from typing import Any

import numpy as np

from analytic.droplets import Modified, optics

_HG = 0.99  # g of the curve of Fig. 2


def droplets() -> dict[str, Any]:
    """Return what light does in the paper's cloud, r_e = 6 um, gamma = 2, 4e8 droplets in a cubic metre.

    Returns
    -------
    dict
        `g` [1]; `forward`, `peak`, `lobe`: shares of the light within 90 degrees, within 5, and between; `cut`, the
        share that a density must lose for a peak that is cut; `path`, the mean free path [m]; `extinction`, that of eq.
        4 over Mie's; `conserved`: what is scattered beyond the peak by the modified phase function as printed, and as
        matched, over what the full one scatters there; `back`: Henyey and Greenstein's function with the g of Fig. 2
        over Mie's, the mean over the backward hemisphere.
    """
    green = optics()
    matched, printed = Modified(green), Modified(green, share="printed")
    full = green.extinction * float(green(0.0))
    mean_backward = 2 * green.share(90, 180)
    # (1/2) int_{-1}^0 of the function over c is (1 - g^2)/(2 g) [1/sqrt(1 + g^2) - 1/(1 + g)].
    lobe = (1 - _HG**2) / _HG * (1 / np.sqrt(1 + _HG**2) - 1 / (1 + _HG))
    return {
        "g": green.g,
        "forward": green.share(0, 90),
        "peak": green.share(0, 5),
        "lobe": green.share(5, 90),
        "cut": matched.removed,
        "path": green.mean_free_path,
        "extinction": green.printed_extinction / green.extinction,
        "conserved": {
            "printed": printed.extinction * float(printed(0.0)) / full,
            "matched": matched.extinction * float(matched(0.0)) / full,
        },
        "back": float(lobe / mean_backward),
    }
