# SPDX-License-Identifier: BSD-3-Clause
"""The columns of a row: names, types, units and what they mean. The Parquet of a sweep has these and no others.

A row is a plain dictionary with a value for every column; what is not known, not measured or not finite is None, never
NaN or an infinity. Beside the columns of `COLUMNS` a row has those of the scene's properties, `property.NAME`, numbers
in float64: the Parquet has every property that any of its rows has. One row stands for one cell, and `key` is its
identity: two rows of one key say the same. A sweep writes its Parquet as `sweep.parquet` into its folder.

Errors are those of the airlight, by the formulae of `validation.metrics`, as `airlight compare --metrics all` prints
them. Where the epsilon of a formula is a radiance, the column `normalised.NAME` has the same with the mean of the truth
as the unit.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from analytic.errors import InputError

#: What came of a cell. 'done': numbers; 'refused': the method, or the truth, says that it cannot do this scene, and
#: `reason` why; 'failed': an exception; 'hung': stopped at the time limit; 'aborted': its process died every time.
STATUSES = ("done", "refused", "failed", "hung", "aborted")

#: How frames are timed: 'none', 'with' the computation of errors, whatever else runs on the host, or 'alone', where
#: nothing else of the sweep runs there.
TIMES = ("none", "with", "alone")

#: Who made the truth of a row.
TRUTHS = ("quadrature", "single-scatter", "volpath")

#: Begins the reason of a row whose scene has no truth: the method was not asked.
NO_TRUTH = "truth of "

PROPERTY = "property."  #: begins the names of the columns of properties

#: Types of columns, and the Python types that their values may have.
_TYPES: dict[str, tuple[type, ...]] = {
    "string": (str,),
    "int32": (int,),
    "int64": (int,),
    "float64": (float, int),
    "bool": (bool,),
    "binary": (bytes,),
}


@dataclass(frozen=True)
class Column:
    """A column of the Parquet."""

    name: str
    kind: str  #: 'string', 'int32', 'int64', 'float64', 'bool' or 'binary'
    unit: str  #: '1' for a number without a unit, empty for what is no number
    meaning: str  #: one line, also the description in the Parquet's schema


def _columns(kind: str, unit: str, meanings: Mapping[str, str]) -> tuple[Column, ...]:
    return tuple(Column(name, kind, unit, meaning) for name, meaning in meanings.items())


_RADIANCE = "W/(m^2 sr)"

_IDENTITY = (
    *_columns(
        "string",
        "",
        {
            "key": "SHA-256, in hexadecimal, of everything that decides the numbers: the identity of the row",
            "study": "name of the study that computed it first",
            "scene": "built-in scene, 'random:SEED', or the path of a file",
        },
    ),
    Column("seed", "int64", "1", "of a random scene; null for others"),
    *_columns(
        "string",
        "",
        {
            "medium": "changes to the scene's medium, 'medium.sigma_t=0.1' and so on; null for the scene's own",
            "method": "name of the method",
            "kernel": "name of its kernel; null where it calls none",
            "parameters": "JSON object of the parameters that differ from their defaults, '{}' for none",
            "label": "method, kernel and parameters as tables name them, such as 'ray-march (steps=16)'",
        },
    ),
    *_columns(
        "int32",
        "pixels",
        {
            "map": "side of the shadow map; null where the method has none",
            "width": "of the image",
            "height": "of the image",
        },
    ),
)

_OUTCOME = (
    Column("status", "string", "", f"what came of the cell: {', '.join(STATUSES)}"),
    Column("reason", "string", "", "why it was not done; null where it was"),
    Column("attempts", "int32", "1", "how often the cell was begun: more than 1 where processes died under it"),
)

_ERRORS = (
    *_columns(
        "int32",
        "pixels",
        {
            "pixels": "compared",
            "masked": "left out: seven of eight where a light has an extent, whose truth is dear",
            "nonfinite": "with NaN or infinity in the method's image; left out of every average",
            "negative": "with a negative value in the method's image",
            "outside_bound": "whose error exceeds the truth's bound, `bound` and rounded ends; null without `bound`",
        },
    ),
    Column("bound", "float64", "1", "error that the method states for itself here, relative to the pixel as in `max`"),
    *_columns(
        "float64",
        _RADIANCE,
        {
            "mean": "mean of the method's airlight",
            "bias": "mean error",
            "rmse": "root of the mean square error",
            "mae": "mean absolute error",
        },
    ),
    Column("mse", "float64", f"({_RADIANCE})^2", "mean square error"),
    *_columns(
        "float64",
        "1",
        {
            "relative_bias": "bias over the mean of the truth",
            "relative_rmse": "rmse over the mean of the truth",
            "p50": "median of |test - truth| / max(truth, 0.001 mean(truth))",
            "p99": "99 % quantile of the same",
            "max": "largest of the same",
            "rae_tev": "tev's relative absolute error",
            "rse_tev": "tev's relative squared error",
            "mrse_pbrt": "pbrt's MRSE",
            "relmse": "SimpleImageIO's relative MSE",
            "relmse_trim": "that without the largest 0.1 % of the values",
            "mape": "JERI's MAPE",
            "smape": "JERI's SMAPE",
            "mrse_jeri": "JERI's MRSE",
            "relative": "mean of |test - truth| / truth where the truth is at least a thousandth of its mean",
            "relative_max": "largest of the same",
            "dark_max": "largest |test - truth| elsewhere, over the mean of the truth",
        },
    ),
    Column("psnr", "float64", "dB", "peak signal to noise, with the truth's peak; null for equal images"),
    Column("dark", "int32", "1", "values of the truth below a thousandth of its mean"),
    *(
        Column(f"normalised.{name}", "float64", "1", f"`{name}` of radiances divided by the mean of the truth")
        for name in ("rae_tev", "rse_tev", "mrse_pbrt", "relmse", "relmse_trim", "mape", "smape", "mrse_jeri")
    ),
    *_columns(
        "float64",
        "1",
        {
            f"colour.{metric}_{which}": f"{words} {of}"
            for metric, of in (("ciede2000", "CIEDE2000"), ("itp", "Delta E ITP"))
            for which, words in (("mean", "mean"), ("p99", "99 % quantile of"), ("max", "largest"))
        },
    ),
    Column("flip", "float64", "1", "HDR-FLIP; null where the study does not ask for it, or it has no answer"),
    *_columns(
        "float64",
        "1",
        {
            "surface_relative_rmse": "relative_rmse of the lit surfaces; null without any, and for lights with extent",
            "surface_p99": "p99 of the lit surfaces",
            "surface_max": "max of the lit surfaces",
        },
    ),
    Column("surface_nonfinite", "int32", "pixels", "with NaN or infinity on the lit surfaces"),
)

_TRUTH = (
    Column("truth", "string", "", f"estimator of the truth: {', '.join(TRUTHS)}"),
    Column("truth_mean", "float64", _RADIANCE, "mean of the true airlight"),
    Column(
        "truth_error",
        "float64",
        "1",
        "the truth's own error over its mean: the mean of the quadrature's bound, for lights with extent three "
        "standard errors added; the pooled standard error of Monte Carlo",
    ),
    Column("truth_worst", "float64", "1", "that of the worst pixel, relative to it as in `max`"),
    Column("truth_s", "float64", "s", "that the truth took when it was computed, shared by all cells of the scene"),
    Column("truth_cpu_s", "float64", "s", "processor time of that, of all threads"),
)

_COST = (
    *_columns(
        "float64",
        "ms",
        {
            "prepare_ms": "for the state of a scene: a second preparation, with kernels compiled",
            "first_ms": "from the scene to the first image, compilation included",
            "frame_ms": "median of a frame: camera rays, lit surface, airlight",
            "frame_ms_low": "first quartile of a frame",
            "frame_ms_high": "third quartile of a frame",
            "frame_cpu_ms": "least processor time of a frame, of all threads: what a busy machine changes least",
            "airlight_ms": "median of the airlight of a frame alone; of a slow frame that of the whole",
            "work_ms": "that the cell took from its beginning to its row",
            "cpu_ms": "processor time of that, of all threads",
        },
    ),
    Column("frames", "int32", "1", "frames that were timed"),
    Column("timed_alone", "bool", "", "whether nothing else of the sweep ran on the host while frames were timed"),
    *_columns(
        "int64",
        "1",
        {
            "crossings": "of all camera rays with edges between light and shadow, as the quadrature finds them",
            "rays": "camera rays of the image",
            "lights": "lights that the method renders, the points of those with extent among them",
        },
    ),
    Column("bytes", "int64", "bytes", "of the device's memory at the peak of preparation and frame"),
    *_columns(
        "int32",
        "1",
        {
            "kernels": "kernels that preparation and first frame launched",
            "compiled": "of these, how many LLVM or CUDA compiled anew",
        },
    ),
    Column("peak_mib", "float64", "MiB", "largest resident memory of the process until then"),
)

_ORIGIN = (
    *_columns(
        "string",
        "",
        {
            "host": "name of the machine",
            "device": "processor or GPU",
            "variant": "Mitsuba's variant",
        },
    ),
    Column("threads", "int32", "1", "of Dr.Jit"),
    *_columns(
        "string",
        "",
        {
            "started": "when the cell began, UTC, as 2026-11-23T08:30:00Z",
            "airlight": "version",
            "source": "digest of airlight's source code, its first 12 digits",
            "mitsuba": "version",
            "drjit": "version",
            "python": "version",
            "command": "the command that shows this image against its truth again",
        },
    ),
    Column("picture", "binary", "", "WebP: truth, image and error side by side, of the worst rows of a method alone"),
)

#: Every column but those of properties, in the order of the Parquet.
COLUMNS: tuple[Column, ...] = (*_IDENTITY, *_OUTCOME, *_ERRORS, *_TRUTH, *_COST, *_ORIGIN)

_BY_NAME = {column.name: column for column in COLUMNS}


def checked_row(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row with every column, in order; what is missing or not finite is None.

    Parameters
    ----------
    values
        By name of the column; properties as 'property.NAME'.

    Raises
    ------
    InputError
        For a name that is no column, a value of another type, and a row without key or status.
    """
    names = [*_BY_NAME, *sorted(name for name in values if name.startswith(PROPERTY))]
    unknown = sorted(set(values) - set(names))
    if unknown:
        raise InputError(f"row: got {unknown[0]!r}, which is no column; see validation/study/row.py")
    row = {name: _checked(name, values.get(name)) for name in names}
    if not row["key"] or row["status"] not in STATUSES:
        raise InputError(f"row: got the key {row['key']!r} and the status {row['status']!r}; wanted both")
    return row


def property_names(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the columns of properties that any row has, in order."""
    return sorted({name for row in rows for name in row if name.startswith(PROPERTY)})


def arrow_schema(properties: Iterable[str] = ()) -> Any:
    """Return the `pyarrow.Schema` of the Parquet, with descriptions and units; `properties` as of `property_names`."""
    import pyarrow as pa

    named = (*COLUMNS, *(Column(name, "float64", "1", "of the scene") for name in properties))
    return pa.schema(
        [
            pa.field(
                column.name,
                pa.type_for_alias(column.kind),
                nullable=column.name not in ("key", "status"),
                metadata={"unit": column.unit, "meaning": column.meaning},
            )
            for column in named
        ]
    )


def _checked(name: str, value: Any) -> Any:
    kind = _BY_NAME[name].kind if name in _BY_NAME else "float64"
    if hasattr(value, "item"):  # a number of NumPy's
        value = value.item()
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return None
    if type(value) not in _TYPES[kind]:  # a truth value is an integer to `isinstance`
        raise InputError(f"row: got {value!r} in the column {name}, wanted {kind}")
    return float(value) if kind == "float64" else value
