# SPDX-License-Identifier: BSD-3-Clause
"""Which layer of another renderer's image is judged, and what light it holds."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.ray_values import ReferenceImage
from reference.storage.exr import TOTAL, Image, layer, layer_names
from validation.arrays import Array
from validation.estimates.quadrature import reference_layer

AIRLIGHT, SURFACE = "airlight", "surface"
KINDS = (AIRLIGHT, SURFACE, TOTAL)  #: what a layer may hold; the total is the sum of the others

# The last part of a layer's name, in small letters; Blender calls its passes VolumeDir and Volume Direct.
_HOLDS = {AIRLIGHT: AIRLIGHT, "volumedir": AIRLIGHT, "volume direct": AIRLIGHT, SURFACE: SURFACE}
_WHOLE = "combined"  # the last part of the name that Blender gives to all light


@dataclass(frozen=True)
class JudgedLayer:
    """A layer of an image."""

    name: str
    holds: str  #: 'airlight', 'surface' or 'total'
    values: NDArray[np.floating]  #: (height, width, 3) [W/(m^2 sr)]
    emitted: bool = True  #: whether its total shows the area lights themselves: files of our own do not

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return int(self.values.shape[1]), int(self.values.shape[0])


def judged_layer(
    image: Image, path: str | os.PathLike[str], *, name: str | None = None, holds: str | None = None
) -> JudgedLayer:
    """Return the layer to judge.

    `name`: the layer: by default 'airlight' where there is one, else the plain channels, else the only layer, else the
    only one that Blender calls Combined; `holds`: what it holds, one of `KINDS`: by default what its name says, else
    all light.
    """
    if holds is not None and holds not in KINDS:
        raise InputError(f"holds {holds}; expected one of {', '.join(KINDS)}")
    chosen = _usual(image, path) if name is None else name or TOTAL
    values = layer(image, chosen, path)
    emitted = "emitted" not in image.layers and "airlight:scene" not in image.attributes
    return JudgedLayer(chosen, holds or _HOLDS.get(chosen.rpartition(".")[2].lower(), TOTAL), values, emitted)


def expected_layer(reference: ReferenceImage, judged: JudgedLayer) -> Array:
    """Return the correct values of a layer, (height, width, 3) [W/(m^2 sr)]."""
    return reference_layer(reference, judged.holds, emitted=judged.emitted)


def _usual(image: Image, path: str | os.PathLike[str]) -> str:
    colours = [each for each in image.layers if not each.endswith("_se")]
    for usual in (AIRLIGHT, TOTAL):
        if usual in colours:
            return usual
    whole = [each for each in colours if each.rpartition(".")[2].lower() == _WHOLE]
    for several in (colours, whole):
        if len(several) == 1:
            return several[0]
    raise InputError(
        f"{path} has no channels R, G, B and no layer 'airlight'; it has {layer_names(image)}"
        + ("; name one by --layer" if colours else "")
    )
