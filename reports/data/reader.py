# SPDX-License-Identifier: BSD-3-Clause
"""report.json as records and back, without Mitsuba, and without measuring anything."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from pathlib import Path, PureWindowsPath
from typing import Any, get_args, get_type_hints

from analytic.errors import InputError
from reports.data.records import SCHEMA, Report
from validation.columns import described, record_of


def read_report(path: Path | str) -> Report:
    """Read a report.json of the current schema, or that of a folder."""
    file = _report_file(path)
    data = read_json(file, f"what `airlight report -o {file.parent}` writes")
    given = data.get("schema") if isinstance(data, dict) else None
    if given != SCHEMA:
        got = f"the schema {given!r}" if given is not None else "no schema"
        raise InputError(f"{file} has {got}, expected {SCHEMA!r}; make the report again with this version of airlight")
    from msgspec import ValidationError

    try:
        return record_of(data, Report)
    except ValidationError as error:
        words, _, place = str(error).partition(" - at `$")
        where = f"report{place.rstrip('`')}"
        raise InputError(f"{file} does not keep to {SCHEMA}: {where}: {words}; make the report again") from None


def load_report(path: Path | str) -> tuple[Report, Path]:
    """Read a report, check that every file it names is there, and return it with the folder of the files."""
    report, file = read_report(path), _report_file(path)
    for name in named_files(report):
        # `C:name` is relative to the folder of another drive.
        if Path(name).is_absolute() or PureWindowsPath(name).drive or ".." in Path(name).parts:
            raise InputError(f"{file} names {name}, which is not in its folder; make the report again")
        if not (file.parent / name).is_file():
            raise InputError(f"{file} names {name}, which is not beside it; move a report with its whole folder")
    return report, file.parent


def read_json(path: Path, wanted: str) -> Any:
    """Return the content of a JSON file; `wanted` says in words what it should be.

    A number that is not finite stays the word that stands there, so that no record takes it.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_float=_finite, parse_constant=_finite)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; expected {wanted}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); expected {wanted}") from error


def _finite(digits: str) -> float | str:
    value = float(digits)
    return value if math.isfinite(value) else digits


def _report_file(path: Path | str) -> Path:
    file = Path(path)
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


def schema() -> dict[str, Any]:
    """Return the JSON Schema of report.json, with the meaning of each key."""
    import msgspec

    made, kinds = msgspec.json.schema(Report), record_types()
    for name, shown in made["$defs"].items():
        for key, meaning in meanings(kinds[name]).items():
            shown["properties"][key] = {**shown["properties"][key], "description": meaning}
    return made


def record_types(kind: Any = Report) -> dict[str, type]:
    """Return the classes of a record and of those within it, by name."""
    found: dict[str, type] = {kind.__name__: kind} if isinstance(kind, type) and is_dataclass(kind) else {}
    inside = get_type_hints(kind).values() if found else get_args(kind)
    for each in inside:
        found |= record_types(each)
    return found


def meanings(record: type) -> dict[str, str]:
    """Return the meanings of the keys of a record with their units."""
    units = {each.key: f" [{each.unit}]" * (each.unit not in ("", "1")) for each in described(record).values()}
    return {name: f"{each.meaning}{units[name]}".strip() for name, each in described(record).items()}
