# SPDX-License-Identifier: BSD-3-Clause
"""report.json read back, checked, and its page drawn again: without Mitsuba, and without measuring anything."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path, PureWindowsPath
from typing import Any

from analytic.errors import InputError

SCHEMA = "airlight-report/2"
SCHEMA_FILE = Path(__file__).parent / "schema" / "report-2.json"


def read_report(path: Path | str) -> dict[str, Any]:
    """Read a report.json of the current schema, or that of a folder."""
    file = _report_file(path)
    data = read_json(file, f"what `airlight report -o {file.parent}` writes")
    given = data.get("schema") if isinstance(data, dict) else None
    if given != SCHEMA:
        got = f"the schema {given!r}" if given is not None else "no schema"
        raise InputError(f"{file} has {got}, wanted {SCHEMA!r}; make the report again with this version of airlight")
    schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    missing = [key for key in schema["required"] if key not in data]
    fault = f"{missing[0]!r} is missing" if missing else _fault(data, schema)
    if fault:
        raise InputError(f"{file} does not keep to {SCHEMA}: {fault}; make the report again")
    return data


def load_report(path: Path | str) -> tuple[dict[str, Any], Path]:
    """Read a report, check that every file it names is there, and return it with the folder of the files."""
    data, file = read_report(path), _report_file(path)
    for name in named_files(data):
        # `C:name` is relative to the folder of another drive.
        if Path(name).is_absolute() or PureWindowsPath(name).drive or ".." in Path(name).parts:
            raise InputError(f"{file} names {name}, which is not in its folder; make the report again")
        if not (file.parent / name).is_file():
            raise InputError(f"{file} names {name}, which is not beside it; move a report with its whole folder")
    return data, file.parent


def read_json(path: Path, wanted: str) -> Any:
    """Return what is in a JSON file; `wanted` says in words what it should be."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; wanted {wanted}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); wanted {wanted}") from error


def _report_file(path: Path | str) -> Path:
    file = Path(path)
    named = file.is_file() or (file.suffix and not file.is_dir())
    return file if named else file / "report.json"


def _fault(data: Any, schema: Mapping[str, Any]) -> str | None:
    """Return the first fault of a report with its place; None without a fault."""
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    error = best_match(Draft202012Validator(schema).iter_errors(data))
    if error is None:
        return None
    words = " ".join(error.message.split())
    # The message begins with the offending value, which may be a whole scene.
    return f"{error.json_path.replace('$', 'report', 1)}: {words if len(words) < 200 else f'.. {words[-160:]}'}"


def report_text(data: Mapping[str, Any]) -> str:
    """Return the content of report.json."""
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def redraw_report(data: Mapping[str, Any], folder: Path, target: Path) -> None:
    """Draw the page of what `load_report` returned again, into its own folder or as a whole report into another."""
    from reference.storage.files import ensure_folder, write_bytes, write_text
    from reports.page.render import render_page

    ensure_folder(target)
    page = render_page(dict(data), folder)
    if not target.samefile(folder):
        for name in named_files(data):
            write_bytes(target / name, (folder / name).read_bytes())
        write_text(target / "report.json", report_text(data))
    write_text(target / "report.html", page)


def named_files(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of all files that a report consists of besides its page and its data."""
    for scene in data["scenes"]:
        yield from scene["files"].values()
        for method in scene["methods"]:
            yield from method["files"].values()
