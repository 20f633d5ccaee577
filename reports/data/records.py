# SPDX-License-Identifier: BSD-3-Clause
"""The records of report.json: their fields are its keys, with units and meanings; and how
they are read and written.

`read_report` makes them from the file, without Mitsuba, and refuses values that do not fit their
types. Code that draws a page, a table or a figure, or compares two reports, takes records. None is
`null` in the file: not known, not measured, not finite. Fields with a default came after the first
reports of the version.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path, PureWindowsPath
from typing import Any, TypeVar, get_args, get_type_hints

from airlight.errors import InputError
from airlight.reference.storage.build import Build
from airlight.validation.columns import column, described, record_of
from airlight.validation.kernels.records import Stability
from airlight.validation.papers.claims import Claim as PaperClaim
from airlight.validation.statistics.records import Agreement, MultipleScattering, Number
from airlight.validation.study.row import Row
from airlight.validation.study.settings import Settings, Size
from airlight.validation.timing import Scaling

_T = TypeVar("_T")

SCHEMA = "airlight-report/5"
_BEFORE = "airlight-report/4"  # read too: one key has another name there

Files = Mapping[str, str]  #: names relative to the folder of the report, by what they are


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Two dates."""

    first: str
    last: str


@dataclass(frozen=True, kw_only=True)
class Environment:
    """The software and hardware that made the numbers."""

    versions: Mapping[str, str] = column(meaning="by package")
    platform: str
    processor: str
    threads: int
    variant: str = column(meaning="Mitsuba's")
    device: str | None = column(meaning="the GPU, where there is one", default=None)
    opengl: str | None = column(
        meaning="that draws shaders, and its error on certified integrals", default=None
    )
    llvm: str | None = None
    build: Build | None = column(
        meaning="airlight's version, its `commit` ('unknown' without git), whether files were `changed` since, and "
        "`digest`, the SHA-256 of all its files; `null` in reports before 0.9",
        default=None,
    )

    @property
    def airlight(self) -> str:
        """Which airlight it was: the version, and the commit and the digest
        where the report has them.
        """
        return self.build.words if self.build else str(self.versions.get("airlight"))


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A sentence of the page."""

    kind: str = column(
        meaning="`reference` (whether an estimator confirms it), `left-out` (the fraction that single scattering "
        "leaves out), `image`, `failed` (values that are not finite or negative, shadow rays that "
        "disagree), "
        "`published` (the same in configurations that reproduce a paper with its errors: no "
        "failure), `refused`, "
        "`growth`, `times` (when they were measured, and whether the machine changed meanwhile), "
        "or `not-measured`"
    )
    text: str = column(meaning="the sentence")
    good: bool | None = column(
        meaning="the verdict; `null` for a fact or an undecided check", default=None
    )


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The accuracy of the quadrature."""

    mean: Number = column(unit="W/(m^2 sr)", meaning="of the airlight")
    relative_error: Number = column(
        meaning="its error over that mean, three standard errors of area lights added; `relative_bound` in files "
        "of version 4"
    )
    kind: str | None = column(
        meaning="of that error: `proven`, `estimated` (density grids) or `statistical` (area lights, skies); `null` in "
        "reports of before 2026-11-29",
        default=None,
    )
    surface_error: Number = column(
        meaning="the error of the surface over its mean, standard errors of area lights added; `null` in the dark and "
        "in files of version 4",
        default=None,
    )
    surface_kind: str | None = column(
        meaning="of that error: `estimated` (Mitsuba's single precision) or `statistical`",
        default=None,
    )
    transitions: int = column(meaning="edges of lit intervals")
    missed: Number = column(meaning="fraction of the first shadow rays that disagreed")
    checked: int = column(meaning="shadow rays that checked the lit intervals")
    disagreements: int = column(meaning="of these")
    refined: int = column(meaning="disagreements that were resolved")
    left: int = column(meaning="disagreements that were not: the error has them")


@dataclass(frozen=True, kw_only=True)
class Method(Row):
    """The row of a method in a scene, or of an engine's image: its files,
    and when it was measured.
    """

    files: Files = column(
        meaning="`exr`, `picture`, `error` (a picture of the signed relative error)"
    )
    measured: str = column(
        meaning="date of the image and its errors; that of its times is `times.run.started`"
    )
    seconds: float = column(unit="s", meaning="that it took")
    cached: bool = column(meaning="whether an earlier run made the image and its errors")


@dataclass(frozen=True, kw_only=True)
class SceneFiles:
    """The files of a reference: an EXR, a picture of all light and one of the airlight alone."""

    exr: str
    picture: str
    airlight: str


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The measurements in a scene."""

    name: str = column(meaning="of the scene")
    purpose: str = column(meaning="what it is for")
    published: str = column(meaning="the published figure that it stands for")
    path: str | None = column(meaning="of a user's file")
    size: Size = column(unit="pixels", meaning="width and height of its images")
    timed: Size = column(unit="pixels", meaning="of the frames that are timed")
    plan: Mapping[str, str] = column(meaning="the features of the scene in words")
    notes: tuple[str, ...] = column(meaning="remarks for the reader")
    reference: Reference = column(meaning="the accuracy of the quadrature")
    exposure: float = column(
        meaning="the factor before the tone curve of all pictures of the scene"
    )
    agreement: Mapping[str, Agreement] = column(
        meaning="checks of the reference, by name as `volpath airlight`"
    )
    multiple: MultipleScattering = column(
        meaning="fractions of airlight and of all light that scatter more than once"
    )
    files: SceneFiles = column(
        meaning="of the reference: `exr`, `picture`, `airlight` (a picture of it alone)"
    )
    methods: tuple[Method, ...] = column(
        meaning="what methods and images cost, and how wrong they are"
    )
    seconds: Mapping[str, float] = column(
        unit="s", meaning="that its parts took when they were computed"
    )


@dataclass(frozen=True, kw_only=True)
class Report:
    """The content of report.json."""

    schema: str = column(meaning="the schema and its version")
    created: str = column(meaning="date and time of the report")
    command: str = column(meaning="the command line that reproduces it")
    seconds: float = column(
        unit="s", meaning="of the measurements in this run, without drawing the page"
    )
    parts: Mapping[str, float] = column(
        unit="s", meaning="of this run: `scenes`, `stability`, `scaling`, `papers`"
    )
    cached: int = column(meaning="number of results that an earlier run computed")
    computed: int = column(meaning="number of results that this run computed")
    measured: Measured | None = column(
        meaning="when the oldest and the newest result were; `null` without any"
    )
    settings: Settings = column(meaning="what the study asked for")
    environment: Environment = column(
        meaning="what made the numbers: versions, processor, variant, LLVM or device"
    )
    claims: tuple[Claim, ...] = column(meaning="the sentences of the page")
    scenes: tuple[Scene, ...] = column(meaning="what was measured, by scene")
    stability: tuple[Stability, ...] = column(
        meaning="by kernel, where it breaks; empty with `--quick`"
    )
    scaling: tuple[Scaling, ...] = column(
        meaning="how times grow with the work; empty without `--full`", default=()
    )
    papers: tuple[PaperClaim, ...] = column(
        meaning="claims of papers, as `airlight paper` prints them", default=()
    )


# The file


def read_report(path: Path | str) -> Report:
    """Read a report.json of this schema or of the one before, by its path or its folder."""
    file = _report_file(path)
    data = read_json(file, f"what `airlight report -o {file.parent}` writes")
    # Another schema is refused by its name: its values could fit these types and mean something
    # else.
    given = data.get("schema") if isinstance(data, dict) else None
    if given not in (SCHEMA, _BEFORE):
        got = f"the schema {given!r}" if given is not None else "no schema"
        raise InputError(
            f"{file} has {got}, expected {SCHEMA!r}; make the report again with this version of "
            "airlight"
        )
    from msgspec import ValidationError

    rename_old_keys(data)
    try:
        return record_of(data, Report)
    except ValidationError as error:
        # msgspec names the place as `$.scenes[0].size`; the message names it as
        # `report.scenes[0].size`.
        words, _, place = str(error).partition(" - at `$")
        where = f"report{place.rstrip('`')}"
        raise InputError(
            f"{file} does not keep to {SCHEMA}: {where}: {words}; make the report again"
        ) from None


def rename_old_keys(data: dict[str, Any]) -> None:
    """Give the error of a reference in a report of the schema before the name that it has now."""
    scenes = data.get("scenes")
    for scene in scenes if isinstance(scenes, list) else ():
        reference = scene.get("reference") if isinstance(scene, dict) else None
        if isinstance(reference, dict) and "relative_bound" in reference:
            reference["relative_error"] = reference.pop("relative_bound")


def load_report(path: Path | str) -> tuple[Report, Path]:
    """Read a report, check that every file it names is there, and return it with
    the folder of the files.
    """
    report, file = read_report(path), _report_file(path)
    for name in named_files(report):
        # `C:name` is relative to the folder of another drive.
        if Path(name).is_absolute() or PureWindowsPath(name).drive or ".." in Path(name).parts:
            raise InputError(
                f"{file} names {name}, which is not in its folder; make the report again"
            )
        # A page with missing pictures would be drawn in silence.
        if not (file.parent / name).is_file():
            raise InputError(
                f"{file} names {name}, which is not beside it; move a report with its whole folder"
            )
    return report, file.parent


def read_json(path: Path, wanted: str) -> Any:
    """Return the content of a JSON file; `wanted` says in words what it should be.

    A number that is not finite stays the word that stands there, so that no record takes it.
    """
    try:
        return json.loads(
            path.read_text(encoding="utf-8"), parse_float=_finite, parse_constant=_finite
        )
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; expected {wanted}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); expected {wanted}") from error


def read_versioned(file: Path, record: type[_T], schema: str, wanted: str, again: str) -> _T:
    """Return the record in a JSON file that says its schema; refuse a file of another kind or
    version.

    `wanted`: what it should be, `again`: what to do where it is not, both in words.
    """
    from msgspec import ValidationError

    found = read_json(file, wanted)
    if not isinstance(found, dict) or found.get("schema") != schema:
        kind = wanted.removeprefix("a ")
        raise InputError(f"{file} is no {kind} of this version, {schema}; {again}")
    try:
        return record_of(found, record)
    except ValidationError as error:
        raise InputError(f"{file}: {error}; expected {wanted}") from error


def _finite(digits: str) -> float | str:
    value = float(digits)
    return value if math.isfinite(value) else digits


def _report_file(path: Path | str) -> Path:
    file = Path(path)
    # A name with a suffix that is no folder is meant as the file, also where it is missing, so that
    # the message names it.
    named = file.is_file() or (file.suffix and not file.is_dir())
    return file if named else file / "report.json"


def report_text(report: Report) -> str:
    """Return the content of report.json."""
    return json.dumps(asdict(report), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def named_files(report: Report) -> Iterator[str]:
    """Yield the names of all files that a report consists of besides its page and its data."""
    for scene in report.scenes:
        yield from vars(scene.files).values()
        for method in scene.methods:
            yield from method.files.values()


def record_types(kind: Any = Report) -> dict[str, type]:
    """Return the classes of a record and of those within it, by name."""
    found: dict[str, type] = (
        {kind.__name__: kind} if isinstance(kind, type) and is_dataclass(kind) else {}
    )
    # The fields of a record, or the arguments of a generic type such as tuple[Scene, ...].
    inside = get_type_hints(kind).values() if found else get_args(kind)
    for each in inside:
        found |= record_types(each)
    return found


def meanings(record: type) -> dict[str, str]:
    """Return the meanings of the keys of a record with their units."""
    units = {
        each.key: f" [{each.unit}]" * (each.unit not in ("", "1"))
        for each in described(record).values()
    }
    return {
        name: f"{each.meaning}{units[name]}".strip() for name, each in described(record).items()
    }
