# SPDX-License-Identifier: BSD-3-Clause
"""A row: all results of one cell. Its columns, with heading, unit and meaning,
are the fields of `Row`.

A row leaves as JSON, records within records, and as a row of a Parquet, whose columns have the
paths of the values in that JSON as names: `error.relative_rmse`, `times.frame.median_ms`. Values
that are not known, not measured or not finite are null, never NaN or an infinity. In addition a
Parquet has the properties of scenes that any of its rows has, `properties.NAME`. `key` is the
identity of a row: two rows of one key have the same numbers.

Errors are those of the airlight, by the formulae of `validation.metrics`, as `airlight compare
--metrics all` prints them. Where the epsilon of a formula is a radiance, `normalised` has the same
with the mean of the reference as unit.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from airlight.validation.columns import Column, column, columns_of, plain, shown_values
from airlight.validation.metrics.colour import ColourDifference
from airlight.validation.metrics.errors import RADIANCE, Metrics, RunsError
from airlight.validation.metrics.flip import Flip
from airlight.validation.metrics.other_tools import PublishedErrors
from airlight.validation.timing import FrameTimes, Timing

if TYPE_CHECKING:  # an extra, which only writers of Parquet need
    import pyarrow as pa

#: Outcomes of a cell. 'done': numbers; 'refused': the method, or the reference, says that it cannot
#: do this scene, and `reason` why; 'left out': a frame would take too long; 'failed': an exception;
#: 'hung': stopped at the time limit; 'aborted': its process died every time.
STATUSES = ("done", "refused", "left out", "failed", "hung", "aborted")

#: Begins the reason of a row whose scene has no reference: the method was not asked.
NO_REFERENCE = "reference of "

PROPERTY = "properties."  #: begins the names of the columns of properties
FRAME_MS = "times.frame.median_ms"  #: the column of the time of a frame


@dataclass(frozen=True)
class ReferenceError:
    """The reference of a cell and the error of the reference."""

    estimator: str = column("reference", "", "estimator of the reference")
    mean: float = column("mean", RADIANCE, "mean of the reference airlight")
    error: float | None = column(
        "own error",
        "1",
        "RMS of its error over its mean, three standard errors of area lights added",
    )
    worst: float | None = column(
        "own error, worst", "1", "that of the worst pixel, relative to it as in `error.max`"
    )
    seconds: float = column(
        "time", "s", "that it took when it was computed, shared by all cells of the scene"
    )
    cpu_seconds: float = column("processor", "s", "processor time of that, of all threads")
    crossings: int | None = column(
        "crossings", "1", "of all camera rays with edges between light and shadow"
    )
    kind: str | None = column(
        "its kind", "", "of its own error: proven, estimated or statistical", default=None
    )


@dataclass(frozen=True)
class StatedError:
    """The error that a method states for itself (`validation.study.stated_errors`)."""

    bound: float = column(
        "stated", "1", "error that the method states here, relative to the pixel as in `error.max`"
    )
    outside: int = column(
        "outside", "pixels", "whose error exceeds the bounds of method, reference and rounded ends"
    )


@dataclass(frozen=True)
class EquationError:
    """The error of an engine's equation apart from that of its algorithm
    (`validation.engine.model_errors`): relative root mean squares over blocks of pixels.
    """

    name: str = column("model", meaning="of the equation; empty for terms without a name")
    terms: str = column("terms", meaning="that differ from the physical equation")
    algorithm: float | None = column("of the algorithm", "1", "image against model")
    equation: float | None = column(
        "of the equation", "1", "model against physics; null where physics has no light"
    )
    total: float | None = column("of both", "1", "image against physics")
    correlation: float | None = column("correlation", "1", "of both parts")


@dataclass(frozen=True)
class Cost:
    """The cost of a cell besides the times of its frames."""

    first_ms: float = column(
        "first frame", "ms", "from the scene to the first image, compilation included"
    )
    prepare_ms: float | None = column(
        "preparation",
        "ms",
        "for the state of a scene: a second preparation, with kernels compiled",
        default=None,
    )
    kernels: int | None = column(
        "kernels", "1", "that preparation and first frame launched", default=None
    )
    compiled: int | None = column(
        "compiled", "1", "of these, how many LLVM or CUDA compiled", default=None
    )
    bytes: int | None = column(
        "device memory", "bytes", "at the peak of preparation and frame", default=None
    )
    lights: int | None = column(
        "lights", "1", "that the method renders, light samples among them", default=None
    )
    work_ms: float | None = column(
        "work", "ms", "that the cell took from its beginning to its row", default=None
    )
    cpu_ms: float | None = column(
        "processor", "ms", "processor time of that, of all threads", default=None
    )
    alone: bool | None = column(
        "alone", "", "whether nothing else of the study ran beside timed frames", default=None
    )


@dataclass(frozen=True)
class Growth:
    """A step of work that grows (`validation.study.growth`)."""

    kind: str = column("work", meaning="'size', 'triangles', 'lights' or 'map'")
    amount: float = column(
        "amount", "1", "pixels, triangles, lights, or texels on a side of the map"
    )
    rays: Timing | None = column("rays alone", meaning="camera rays without shading", default=None)


@dataclass(frozen=True)
class Origin:
    """Where and by what a row was computed."""

    airlight: str = column(meaning="version")
    commit: str = column(
        meaning="of airlight; 'unknown' where neither git nor who built the copy tells"
    )
    changed: bool | None = column(
        meaning="whether airlight's files differ from those of the commit"
    )
    digest: str = column(meaning="SHA-256 of airlight's files")
    source: str = column(
        meaning="digest of the code that computes rows, comments apart, its first 12 digits"
    )
    host: str | None = column(meaning="name of the machine", default=None)
    device: str | None = column(meaning="processor or GPU", default=None)
    variant: str | None = column(meaning="Mitsuba's variant", default=None)
    threads: int | None = column(meaning="of Dr.Jit", default=None)
    started: str | None = column(
        meaning="when the cell began, UTC, as 2026-11-23T08:30:00Z", default=None
    )
    mitsuba: str | None = column(meaning="version", default=None)
    drjit: str | None = column(meaning="version", default=None)
    python: str | None = column(meaning="version", default=None)


@dataclass(frozen=True)
class Row:
    """The results of one cell."""

    scene: str = column(meaning="built-in scene, 'random:SEED', or the path of a file")
    label: str = column(
        "method", meaning="method, kernel and parameters, such as 'ray-march (steps=16)'"
    )
    method: str = column(meaning="name of the method")
    kernel: str | None = column(meaning="name of its kernel; null where it calls none")
    parameters: str = column(
        meaning="JSON object of the parameters that differ from their defaults, '{}' for none"
    )
    width: int = column(unit="pixels", meaning="of the image")
    height: int = column(unit="pixels", meaning="of the image")
    status: str = column(meaning=f"what came of the cell: {', '.join(STATUSES)}")
    reason: str | None = column(meaning="why it was not done; null where it was", default=None)
    note: str | None = column(meaning="how its times differ from those of other rows", default=None)
    kind: str = column(
        meaning="'built-in', 'function' of the user, or 'image' of an engine", default="built-in"
    )
    layer: str = column(
        meaning="what `error` is of: 'airlight', 'surface' or 'total'", default="airlight"
    )
    pixel: str = column(
        meaning="a pixel of the reference: 'centre' or mean over its 'area'", default="centre"
    )
    knows_shadows: bool = column(
        "shadows", meaning="whether it renders volumetric shadows", default=True
    )
    device: str | None = column(
        meaning="that OpenGL draws a shader on, of which its times are; null for methods of Dr.Jit",
        default=None,
    )
    map: int | None = column(
        unit="texels", meaning="side of the shadow map; null without one", default=None
    )
    seed: int | None = column(meaning="of a random scene; null for others", default=None)
    medium: str | None = column(
        meaning="changes of the medium, 'medium.sigma_t=0.1' and so on; null for the scene's own",
        default=None,
    )
    error: Metrics | None = None
    model: EquationError | None = None
    noise: RunsError | None = None
    surface_error: Metrics | None = column("surface", meaning="of the lit surfaces", default=None)
    published: PublishedErrors | None = None
    normalised: PublishedErrors | None = column(
        "normalised", meaning="of radiances divided by the mean of the reference", default=None
    )
    colour: ColourDifference | None = None
    flip: Flip | None = None
    stated: StatedError | None = None
    reference: ReferenceError | None = None
    times: FrameTimes | None = None
    memory: float | None = column(
        "memory",
        "MiB",
        "what a frame takes at its peak, prepared again, with its image on the host, beyond what "
        "was there before",
        default=None,
    )
    cost: Cost | None = None
    work: Growth | None = column(meaning="that a step of growing work has", default=None)
    origin: Origin | None = None
    properties: Mapping[str, float] = field(default_factory=dict)  #: of the scene, by name
    key: str | None = column(
        meaning="digest of everything that decides the numbers: the identity", default=None
    )
    study: str | None = column(meaning="name of the study that computed it first", default=None)
    attempts: int | None = column(
        meaning="how often the cell was begun: more than 1 where processes died under it",
        default=None,
    )
    command: str | None = column(meaning="the command that shows this image again", default=None)
    picture: bytes | None = column(
        meaning=(
            "WebP: reference, image and error side by side, of the worst rows of a method alone"
        ),
        default=None,
    )


#: Every column but those of properties, in the order of the Parquet.
COLUMNS: tuple[Column, ...] = columns_of(Row)


def row_values(row: Row) -> dict[str, Any]:
    """Return the values of a row by the names of its columns; what is not finite is None."""
    return shown_values(row) | {
        f"{PROPERTY}{name}": plain(value) for name, value in row.properties.items()
    }


def property_names(rows: Iterable[Mapping[str, object]]) -> list[str]:
    """Return the columns of properties that any row has, in order."""
    return sorted({name for row in rows for name in row if name.startswith(PROPERTY)})


def arrow_schema(properties: Iterable[str] = ()) -> "pa.Schema":
    """Return the schema of the Parquet, with meanings and units; `properties` as of
    `property_names`.
    """
    import pyarrow as pa

    named = (*COLUMNS, *(Column(name, name, "1", "of the scene", "float64") for name in properties))
    return pa.schema(
        [
            pa.field(
                each.key,
                pa.type_for_alias(each.kind),
                metadata={"unit": each.unit, "meaning": each.meaning},
            )
            for each in named
        ]
    )
