# SPDX-License-Identifier: BSD-3-Clause
"""A comparison of two images as a result of the Python API: the numbers of `airlight compare`, and pictures."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from reports.api.results import Array, Pictured, as_array, read_only
from reports.tables.table import number
from validation.comparison.images import Comparison
from validation.metrics.errors import FLOOR, colours


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ImageComparison(Comparison, Pictured):
    """How far an image is from a reference: the numbers of `airlight compare`, and the images."""

    reference: Array  #: the layer of the reference, (height, width[, channels]) [W/(m^2 sr)]
    test: Array  #: the same layer of the image under test
    names: tuple[str, str] = ("the reference", "the test image")

    @property
    def passed(self) -> bool:
        """Whether the test image has no fault; `failures` names the faults."""
        return not self.failures

    @cached_property
    def error(self) -> Array:
        """The signed relative error (test - ref) / max(ref, 0.001 mean(ref)), of the shape of the images."""
        reference, test = (np.asarray(values, dtype=np.float64) for values in (self.reference, self.test))
        finite = np.isfinite(reference) & np.isfinite(test)
        mean = float(reference[finite].mean()) if finite.any() else math.nan
        with np.errstate(invalid="ignore", divide="ignore"):
            return read_only((test - reference) / np.maximum(reference, FLOOR * mean))

    def numpy(self, dtype: DTypeLike | None = None) -> Array:
        """Return `error` as an array of one's own, which can be written to."""
        return np.array(self.error, dtype=dtype)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return as_array(self.error, dtype, copy)

    def picture(self) -> NDArray[np.uint8]:
        """Return the map of the signed relative error, see `reports.plotting.pictures.error_map`, (height, width,
        3).
        """
        from reports.plotting.pictures import error_map

        reference, test = self._colours()
        return error_map(reference, test)

    def _colours(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        shape = (*self.reference.shape[:2], -1)
        reference, test = (np.asarray(v, dtype=np.float64).reshape(shape) for v in (self.reference, self.test))
        return colours(reference), colours(test)

    def _repr_html_(self) -> str:
        from reports.api.html import block, bullets, picture, table
        from reports.plotting.pictures import ERROR_CEILING, ERROR_FLOOR, exposure, png_bytes, tone_mapped

        reference, test = self._colours()
        factor, width = exposure(reference), reference.shape[1]
        shown = [
            picture(png_bytes(tone_mapped(values, factor)), width, alt=f"{name}, {self.layer}", caption=name)
            for name, values in zip(self.names, (reference, test))
        ]
        scale = f"relative error: blue too dark, red too bright, logarithmic from {ERROR_FLOOR:g} to {ERROR_CEILING:g}"
        shown.append(picture(self._png, width, alt=f"signed relative error of the {self.layer}", caption=scale))
        return block(self.title, *shown, table(self._rows()), bullets([f"failed: {why}" for why in self.failures]))

    def _rows(self) -> list[tuple[str, str]]:
        m = self.metrics
        rows = [
            ("relative RMSE", _percent(m.relative_rmse)),
            ("relative bias", _percent(m.relative_bias)),
            ("relative error, median, 99 %, largest", f"{number(m.p50)}, {number(m.p99)}, {number(m.max)}"),
            ("pixels, masked, not finite, negative", f"{m.pixels}, {self.masked}, {m.nonfinite}, {m.negative}"),
        ]
        if self.statistics is not None:
            low, high = self.statistics.relative_bias_ci
            rows.append(("95 % interval of the bias", f"{_percent(low)} to {_percent(high)}"))
            rows.append(("bias that would have been detected", _percent(self.statistics.detectable_bias)))
        if self.flip is not None:
            rows.append(("HDR-FLIP", f"none: {self.flip.note}" if self.flip.value is None else number(self.flip.value)))
        return rows

    @property
    def title(self) -> str:
        """What is compared with what."""
        return f"{self.layer} of {self.names[1]} against {self.names[0]}"

    def __repr__(self) -> str:
        m = self.metrics
        verdict = "passed" if self.passed else f"failed: {'; '.join(self.failures)}"
        return (
            f"ImageComparison({self.title}: relative RMSE {m.relative_rmse:.3g}, "
            f"relative bias {m.relative_bias:.3g}, {verdict})"
        )


def _percent(value: float) -> str:
    return f"{number(100 * value)} %"
