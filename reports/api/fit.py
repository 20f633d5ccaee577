# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for fits: which parameters of the fog explain an image."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from reports.api.inputs import ImageLike, Progress, SceneLike, as_image, one_error, opened, telling
from validation.fit.fit import Fit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FitResult(Fit):
    """What explains an image: the numbers of `airlight fit`."""

    def __getitem__(self, name: str) -> Mapping[str, Any]:
        """Return 'value', 'low', 'high' and 'scene' of a parameter; lists where its channels differ."""
        parameters: dict[str, Any] = self.to_json()["parameters"]
        return parameters[name]

    def to_dict(self) -> dict[str, Any]:
        """Return what `airlight fit --json` prints."""
        numbers: dict[str, Any] = json.loads(json.dumps(self.to_json()))
        return numbers

    def _repr_html_(self) -> str:
        from reports.api.html import block, bullets
        from reports.tables.drawing import html
        from reports.tables.fit import parameters_table
        from validation.fit.fit_text import fit_lines

        return block(f"fit of {self.path}", html(parameters_table(self.to_json())), bullets(fit_lines(self)))

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name}={each.value:.6g}" for each in self.parameters)
        return f"FitResult({self.path} as {self.scene}: {values}; relative RMSE left {self.residual:.3g})"


@one_error
def fit(
    image: ImageLike,
    scene: SceneLike,
    parameters: str | Sequence[str] = ("sigma_t", "albedo"),
    *,
    layer: str = "airlight",
    holds: Literal["airlight", "surface", "total"] | None = None,
    pixel: Literal["centre", "area"] | None = None,
    mask: "ArrayLike | None" = None,
    starts: Mapping[str, float] | None = None,
    progress: Progress = None,
) -> FitResult:
    """Find the parameters of media, lights and exposure that explain an image.

    Parameters
    ----------
    image
        What `reference` or `render` returned, the path of an EXR file, or an array (height, width, 3) [W/(m^2 sr)].
    scene
        See `load_scene`. What is not looked for is taken from it; its size becomes that of the image.
    parameters
        Some of 'sigma_t', 'albedo' (each also with '.r', '.g', '.b'), 'phase.g', 'intensity', 'exposure', 'light.x',
        'light.y', 'light.z', of one medium or light as 'sigma_t:NAME'.
    layer, holds
        Which layer, and what it holds if its name does not say so.
    pixel
        Whether pixels are values at their centres or means over their areas; by default what fits.
    mask
        Pixels that may take part, (height, width) of truth values; all by default.
    starts
        Values to begin with, by name; the scene's own by default.
    progress
        Called with (share done, what); True shows a bar.

    Raises
    ------
    InputError
        For what is not known, and an image with too few pixels that say something.

    Examples
    --------
    >>> import airlight
    >>> truth = airlight.reference("open-fog", size=(32, 24))
    >>> explained = airlight.fit(truth, "open-fog", ["sigma_t", "intensity"], starts={"sigma_t": 1.0})
    >>> abs(explained["sigma_t"]["value"] / 0.173 - 1) < 1e-4
    True
    """
    import numpy as np

    from validation.comparison.engine_layers import judged_layer
    from validation.fit.fit import fit_image

    layers, name = as_image(image, layer, "the image")
    size = judged_layer(layers, name, name=layer, holds=holds).size
    names = parameters.split(",") if isinstance(parameters, str) else list(parameters)
    loaded = opened(scene, size)
    chosen = None if mask is None else np.asarray(mask)
    with telling(progress, "fit") as tell:
        explained = fit_image(
            layers,
            loaded,
            [word.strip() for word in names],
            path=name,
            layer=layer,
            holds=holds,
            pixel=pixel,
            mask=chosen,
            starts=starts,
            progress=tell,
        )
    return FitResult(**{field.name: getattr(explained, field.name) for field in dataclasses.fields(explained)})
