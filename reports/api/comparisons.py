# SPDX-License-Identifier: BSD-3-Clause
"""Comparisons as results: two images, an image with the reference of its
scene, its diagnosis, its fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from airlight.reference.storage.exr import Image
from airlight.reports.api.results import Array, Pictured, as_array, read_only
from airlight.reports.plotting.pictures import (
    ERROR_CEILING,
    ERROR_FLOOR,
    error_colours,
    error_map,
    exposure,
    png_bytes,
    relative_error,
    tone_mapped,
    write_png,
)
from airlight.reports.tables.record import Said
from airlight.reports.tables.table import Interval, Table, numbers, table, words
from airlight.validation.columns import plain
from airlight.validation.comparison.images import Comparison, shown
from airlight.validation.engine.diagnose import Diagnosis
from airlight.validation.engine.judge import EngineComparison
from airlight.validation.fit.fit import Fit
from airlight.validation.fit.fit import Fitted as FittedParameter
from airlight.validation.metrics.errors import Metrics, colours
from airlight.validation.motion.judge import MotionComparison
from airlight.validation.motion.noise import NoiseComparison


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ImageComparison(Comparison, Pictured):
    """How far an image is from a reference: the numbers of `airlight compare`, and the images."""

    reference: Array  #: the layer of the reference, (height, width[, channels]) [W/(m^2 sr)]
    test: Array  #: the same layer of the image under test
    names: tuple[str, str] = ("the reference", "the test image")
    files: tuple[tuple[str, str], ...] = ()  #: differences that were written, and what they show

    @property
    def passed(self) -> bool:
        """Whether the test image has no fault; `failures` names the faults."""
        return not self.failures

    @cached_property
    def error(self) -> Array:
        """The signed relative error (test - ref) / max(ref, 0.001 mean(ref)), of
        the shape of the images.
        """
        reference, test = (
            np.asarray(values, dtype=np.float64) for values in (self.reference, self.test)
        )
        return read_only(relative_error(reference, test))

    def to_dict(self) -> dict[str, Any]:
        """Return what `airlight compare --json` prints."""
        numbers = {each.name: getattr(self, each.name) for each in fields(Comparison)}
        return plain(numbers) | _differences(self.files)

    @property
    def lines(self) -> Sequence[str]:
        """The numbers, a line for each group."""
        return [*self.summary().split("\n"), *_difference_lines(self.files)]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return as_array(self.error, dtype, copy)

    def picture(self) -> NDArray[np.uint8]:
        """Return the map of the signed relative error, see
        `reports.plotting.pictures.error_map`, (height, width, 3).
        """
        reference, test = self._colours()
        return error_map(reference, test)

    def _colours(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        # A layer of one value a pixel, (height, width), is shown as grey.
        shape = (*self.reference.shape[:2], -1)
        reference, test = (
            np.asarray(v, dtype=np.float64).reshape(shape) for v in (self.reference, self.test)
        )
        return colours(reference), colours(test)

    def _repr_html_(self) -> str:
        from airlight.reports.tables.record import block, bullets, picture

        reference, test = self._colours()
        # Both images are shown in the exposure of the reference: a test image of another brightness
        # must look brighter or darker, not alike.
        factor, width = exposure(reference), reference.shape[1]
        shown = [
            picture(
                png_bytes(tone_mapped(values, factor)),
                width,
                alt=f"{name}, {self.layer}",
                caption=name,
            )
            for name, values in zip(self.names, (reference, test))
        ]
        scale = f"relative error: blue too dark, red too bright, logarithmic from {ERROR_FLOOR:g} to {ERROR_CEILING:g}"
        shown.append(
            picture(
                self._png, width, alt=f"signed relative error of the {self.layer}", caption=scale
            )
        )
        return block(self.title, *shown, bullets(self.lines))

    @property
    def title(self) -> str:
        """The compared layer and images."""
        return f"{self.layer} of {self.names[1]} against {self.names[0]}"

    def __repr__(self) -> str:
        m = self.metrics
        verdict = "passed" if self.passed else f"failed: {'; '.join(self.failures)}"
        return (
            f"ImageComparison({self.title}: relative RMSE {shown(m.relative_rmse, 3)}, "
            f"relative bias {shown(m.relative_bias, 3)}, {verdict})"
        )


class SceneComparison(Said):
    """How far an image is from the reference of a scene; `of` has every number."""

    @property
    def metrics(self) -> Metrics:
        """The errors."""
        compared: EngineComparison = self.of
        return compared.comparison.metrics


def scene_comparison(
    compared: EngineComparison, files: Sequence[tuple[str, str]] = ()
) -> SceneComparison:
    """Return a comparison as a result; `files` are differences that were
    written, and what they show.
    """
    return SceneComparison(
        name=f"{compared.comparison.layer} of {compared.path} against {compared.scene}",
        data=plain(compared) | _differences(files),
        lines=[*compared.summary().split("\n"), *_difference_lines(files)],
        good=not compared.comparison.failures,
        of=compared,
    )


def diagnosed(diagnoses: Sequence[Diagnosis]) -> Said:
    """Return what is wrong with an image: with each of airlight and surfaces
    where it has both as layers.
    """
    # JSON has the first diagnosis under `diagnosis`, and all of them under `layers` where there are
    # several.
    several = plain(diagnoses)
    # Nothing was looked for where an image is right or black.
    searched = [each for each in diagnoses if len(each.ranked) > 1]
    said = "left: mean relative error without the fault; evidence: a score against `right`."
    return Said(
        name=f"{diagnoses[0].path} of {diagnoses[0].scene}: {diagnoses[0].first}",
        data={"diagnosis": several[0]} | ({"layers": several} if len(several) > 1 else {}),
        claims=[line for each in diagnoses for line in each.lines],
        tables=[_ranked(each) for each in searched],
        lines=[said] if searched else [],
        good=not any(diagnosis.failures for diagnosis in diagnoses),
        of=diagnoses,
    )


def _ranked(diagnosis: Diagnosis) -> Table:
    """Return the five faults with the most evidence, each with the error that it leaves."""
    columns = (
        *words(fault="fault"),
        *numbers(left="left", how={"percent": True}),
        *numbers(evidence="evidence", how={"digits": 4}),
        *words(says="the image", how={"long": True}),
    )
    rows = [(each.name, each.residual, each.evidence, each.words) for each in diagnosis.ranked[:5]]
    return table(f"Faults of the {diagnosis.layer}, by their evidence", columns, rows)


def frames_comparison(compared: MotionComparison | NoiseComparison) -> Said:
    """Return how far frames are from the reference of each, or independent renders from theirs."""
    return Said(
        name=f"{compared.files} against {compared.scene}",
        lines=compared.lines,
        good=not compared.failures,
        of=compared,
    )


class Fitted(Said):
    """The parameters of the fog that explain an image; `of` has every number."""

    def __getitem__(self, name: str) -> FittedParameter:
        """Return a parameter, or a channel of it such as 'sigma_t.r': its
        value, low, high and scene.
        """
        fit: Fit = self.of
        return {each.name: each for each in fit.parameters}[name]


def fitted(fit: Fit) -> Fitted:
    """Return a fit as a result."""
    values = ", ".join(f"{each.name}={each.value:.6g}" for each in fit.parameters)
    # A row is a parameter: the fitted value and its 95 % interval, beside the value in the scene.
    columns = numbers(
        value="value", interval="95 % interval", scene="in the scene", how={"digits": 6}
    )
    rows = [
        (each.name, each.value, Interval.of((each.low, each.high)), each.scene)
        for each in fit.parameters
    ]
    return Fitted(
        name=f"{fit.path} as {fit.scene}: {values}; relative RMSE left {fit.residual:.3g}",
        tables=(
            table("Parameters that explain the image", (*words(name="parameter"), *columns), rows),
        ),
        lines=fit.lines,
        good=not fit.failures,
        of=fit,
    )


def write_difference(path: Path, reference: Any, test: Any, *, kept: Any = None) -> str:
    """Write how a test image differs from a reference, whole or not at all; return in
    words what the file shows.

    An .exr file has test - reference [W/(m^2 sr)] in R, G, B, and (test - reference) /
    max(reference, 0.001 mean(reference)) in the layer `relative`; a .png file has the latter in
    false colours, `error_map`. Images are (height, width[, channels]); one channel is grey. Pixels
    outside of `kept`, (height, width), and in EXR files those that are not finite, have no
    difference, and the mean is that of all others.
    """
    reference, test = (
        colours(np.asarray(values, dtype=np.float64).reshape(*np.shape(values)[:2], -1))
        for values in (reference, test)
    )
    # A mask has one truth value a pixel; the new axis spreads it over the colours.
    mask = np.asarray(np.ones(reference.shape[:2], dtype=bool) if kept is None else kept)[..., None]
    # Masked pixels become NaN in the reference, so that one test finds masked pixels and pixels
    # whose difference is not a number.
    relative = relative_error(np.where(mask, reference, np.nan), test)
    if path.suffix.lower() == ".png":
        write_png(path, error_colours(np.where(mask, relative, 0)))
        return (
            "signed relative error, blue too dark, red too bright, "
            f"from {ERROR_FLOOR:g} (white) to {ERROR_CEILING:g}"
        )
    from airlight.reference.storage.exr import write_exr
    from airlight.reports.machine.environment import stamped

    compared = ~np.isnan(relative)
    # Programs that open the file expect finite values: pixels without a difference hold 0, and the
    # attribute counts the unmasked ones.
    difference = np.subtract(test, reference, out=np.zeros_like(test), where=compared)
    shown = np.where(np.isfinite(relative), relative, 0)
    attributes: dict[str, str | int | float] = {
        "airlight:difference": "test - reference",
        "airlight:not_finite": int((mask & ~compared).any(axis=-1).sum()),
    }
    write_exr(path, stamped(Image({"total": difference, "relative": shown}, attributes=attributes)))
    return "test - reference in R, G, B, over the reference in the layer relative"


def _differences(files: Sequence[tuple[str, str]]) -> dict[str, Any]:
    return {"difference": files[-1][0]} if files else {}


def _difference_lines(files: Sequence[tuple[str, str]]) -> list[str]:
    return [f"wrote            {path}: {shown}" for path, shown in files]
