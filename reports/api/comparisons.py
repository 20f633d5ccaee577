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
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Interval, Table, numbers, table, words
from airlight.validation.columns import plain
from airlight.validation.comparison.images import Comparison, shown
from airlight.validation.engine.diagnose import Diagnosis
from airlight.validation.engine.judge import EngineComparison
from airlight.validation.engine.verdict import Verdict
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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SceneComparison(Result):
    """How far an image is from the reference of a scene."""

    compared: EngineComparison  #: every number
    files: tuple[tuple[str, str], ...] = ()  #: differences that were written, and what they show

    @property
    def metrics(self) -> Metrics:
        """The errors."""
        return self.compared.comparison.metrics

    @property
    def verdict(self) -> Verdict:
        """Whether the image is right, within the margin."""
        return self.compared.verdict

    @property
    def title(self) -> str:
        """The compared layer, image and scene."""
        compared = self.compared
        return f"{compared.comparison.layer} of {compared.path} against {compared.scene}"

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.compared.scene

    @property
    def lines(self) -> Sequence[str]:
        """The numbers, a line for each group."""
        return [*self.compared.summary().split("\n"), *_difference_lines(self.files)]

    @property
    def failures(self) -> Sequence[str]:
        """The faults of the image."""
        return self.compared.comparison.failures

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers of two images, and beside them those of the scene."""
        data = plain(self.compared)
        return data.pop("comparison") | data | _differences(self.files)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ImageDiagnosis(Result):
    """The faults of an image: of its airlight and its surfaces where it has both as layers."""

    diagnoses: tuple[Diagnosis, ...]  #: one for each layer

    @property
    def first(self) -> str:
        """The name of what explains the first layer: a fault, 'right', 'black' or 'unexplained'."""
        return self.diagnoses[0].first

    @property
    def title(self) -> str:
        """The image, the scene and the first explanation."""
        one = self.diagnoses[0]
        return f"{one.path} of {one.scene}: {one.first}"

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.diagnoses[0].scene

    @property
    def claims(self) -> Sequence[str]:
        """The explanations, in sentences."""
        return [line for each in self.diagnoses for line in each.lines]

    @property
    def tables(self) -> Sequence[Table]:
        """The likeliest faults; none where nothing was looked for, as the image is right or black."""
        return [_ranked(each) for each in self.diagnoses if len(each.ranked) > 1]

    @property
    def lines(self) -> Sequence[str]:
        """The meaning of the columns."""
        said = "left: mean relative error without the fault; evidence: a score against `right`."
        return [said] if self.tables else []

    @property
    def failures(self) -> Sequence[str]:
        """The faults of the file."""
        return [reason for each in self.diagnoses for reason in each.failures]

    def to_dict(self) -> dict[str, Any]:
        """Return the first diagnosis, and those of all layers where there are several."""
        several = plain(self.diagnoses)
        return {"diagnosis": several[0]} | ({"layers": several} if len(several) > 1 else {})


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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FramesComparison(Result):
    """How far frames are from the reference of each, or independent renders from theirs."""

    compared: MotionComparison | NoiseComparison  #: every number

    @property
    def title(self) -> str:
        """The files and the scene."""
        return f"{self.compared.files} against {self.compared.scene}"

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.compared.scene

    @property
    def lines(self) -> Sequence[str]:
        """The numbers, a line for each group."""
        return self.compared.lines

    @property
    def notes(self) -> Sequence[str]:
        """Whatever was changed or left out when the files were read."""
        return self.compared.notes

    @property
    def failures(self) -> Sequence[str]:
        """The reasons for which the comparison must be called failed."""
        return self.compared.failures

    def to_dict(self) -> dict[str, Any]:
        """Return every number."""
        return plain(self.compared)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FittedFog(Result):
    """The parameters of the fog that explain an image."""

    fit: Fit  #: every number

    def __getitem__(self, name: str) -> FittedParameter:
        """Return a parameter, or a channel of it such as 'sigma_t.r': its
        value, low, high and scene.
        """
        return {each.name: each for each in self.fit.parameters}[name]

    @property
    def title(self) -> str:
        """The image, the scene, the fitted values, and the error that they leave."""
        fit = self.fit
        values = ", ".join(f"{each.name}={each.value:.6g}" for each in fit.parameters)
        return f"{fit.path} as {fit.scene}: {values}; relative RMSE left {fit.residual:.3g}"

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.fit.scene

    @property
    def tables(self) -> Sequence[Table]:
        """A row for each parameter: its value with the 95 % interval, and that in the scene."""
        columns = numbers(
            value="value", interval="95 % interval", scene="in the scene", how={"digits": 6}
        )
        rows = [
            (each.name, each.value, Interval.of((each.low, each.high)), each.scene)
            for each in self.fit.parameters
        ]
        columns = (*words(name="parameter"), *columns)
        return [table("Parameters that explain the image", columns, rows)]

    @property
    def lines(self) -> Sequence[str]:
        """The explanation, in sentences."""
        return self.fit.lines

    @property
    def failures(self) -> Sequence[str]:
        """The faults of the file."""
        return self.fit.failures

    def to_dict(self) -> dict[str, Any]:
        """Return every number."""
        return plain(self.fit)


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
    paths = [path for path, _ in files]
    return {"difference": paths[-1], "differences": paths} if paths else {}


def _difference_lines(files: Sequence[tuple[str, str]]) -> list[str]:
    return [f"wrote            {path}: {shown}" for path, shown in files]
