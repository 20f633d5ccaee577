# SPDX-License-Identifier: BSD-3-Clause
"""Parts that the scenes of clouds share: droplets, sun and sky."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from validation.scenes.parts import fog, tabulated_phase

#: Extinction of the droplets of Bouthors et al. 2008, section 4, at 0.55 um [1/m]: a mean free path of 27.5 m.
EXTINCTION = 0.0363
#: Water absorbs next to nothing of visible light.
_ALBEDO = 0.99997


def cloud(phase: dict[str, Any], extinction: float = EXTINCTION) -> dict[str, Any]:
    """Return a homogeneous cloud.

    Parameters
    ----------
    phase
        Dictionary of the phase function.
    extinction
        [1/m].
    """
    return fog(extinction, (_ALBEDO,) * 3, phase)


def droplets() -> dict[str, Any]:
    """Return the phase function of the droplets of Bouthors et al. 2008 by Mie's theory, green, as a table.

    With 20001 values the forward peak is blurred by 0.8 degrees, glory and fogbow by less than 0.1.
    """
    return tabulated_phase("mie", 20001)


def sun(travels: Sequence[float], irradiance: Sequence[float]) -> dict[str, Any]:
    """Return a directional light.

    Parameters
    ----------
    travels
        The direction in which its light travels, (3,), of any length.
    irradiance
        RGB, across the beam, (3,) [W/m^2].
    """
    return {
        "type": "directional",
        "direction": [float(part) for part in np.asarray(travels) / np.linalg.norm(travels)],
        "irradiance": {"type": "rgb", "value": list(irradiance)},
    }


def sky(radiance: Sequence[float]) -> dict[str, Any]:
    """Return a sky of constant RGB `radiance`, (3,) [W/(m^2 sr)]."""
    return {"type": "constant", "radiance": {"type": "rgb", "value": list(radiance)}}
