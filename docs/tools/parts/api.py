# SPDX-License-Identifier: BSD-3-Clause
"""The public functions and classes of `airlight` by topic, from their docstrings."""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from textwrap import dedent, indent
from typing import Any

from airlight.reports.data import records
from airlight.reports.tables.record import Result
from parts.listed import table

#: The purposes of readers, and the names that serve each; a public name in none of them
#: ends the build.
TOPICS = {
    "Render and judge": (
        "render reference Model compare check capture error_metrics multiple_scattering_fraction Budget"
    ),
    "Measure": "report diff study STUDIES sweep paper configuration time_frame",
    "A number to cite": "challenge_new challenge_score challenge_board",
    "Scenes": "load_scene describe view SCENES certified_data",
    "Methods and kernels": "METHODS find_method KERNELS export",
    "A method of your own": "rays Method Layers parameter marched_steps light_tables light_choice",
    "Frames without files": "activate read_scene frame_renderer render_frame",
    "Images": "read_exr write_exr",
    "The program and the machine": "list doctor versions InputError MissingError",
}
#: Classes that these functions return or are given: nobody imports them.
_RESULTS = (
    "reports.tables.record.Result",
    "reports.api.rays.CameraRays",
    "reports.api.results.Rendering",
    "reports.api.results.Reference",
    "reports.api.comparisons.ImageComparison",
    "reports.api.comparisons.SceneComparison",
    "reports.api.comparisons.ImageDiagnosis",
    "reports.api.comparisons.FittedFog",
    "reports.api.comparisons.FramesComparison",
    "reports.api.check.RelationsKept",
    "reports.api.capture.Capture",
    "validation.check.judge.Kept",
    "reports.api.explore.Description",
    "reports.api.report.Report",
    "reports.api.engines.EnginesReport",
    "reports.api.challenge.ChallengeWritten",
    "reports.api.challenge.ChallengeScore",
    "reports.api.challenge.ChallengeBoard",
    "reports.studies.registry.Study",
    "reports.studies.methods.MethodsStudy",
    "reports.studies.kernels.Integrals",
    "reports.studies.clouds.SlabStudy",
    "validation.metrics.errors.Metrics",
    "reference.storage.exr.Image",
    "realtime.methods.interface.method.View",
)


def names() -> str:
    """Return the public names by topic, each with the first sentence of its documentation."""
    _check_topics()
    rows = [
        (topic if number == 0 else "", *_row(name))
        for topic, words in TOPICS.items()
        for number, name in enumerate(words.split())
    ]
    return table(("for", "name", "what it is"), rows, 3)


def signatures() -> str:
    """Return the documentation of the public names by topic, and of their results."""
    _check_topics()
    parts = []
    for topic, words in TOPICS.items():
        parts.append(f"## {topic}")
        parts += [_entry(name, _public(name)) for name in words.split()]
    parts.append("## What they return and are given")
    for path in _RESULTS:
        module, _, name = path.rpartition(".")
        parts.append(_entry(name, getattr(importlib.import_module(f"airlight.{module}"), name)))
    return "\n\n".join(parts)


def _check_topics() -> None:
    """Refuse topics that lack a public name, or name another."""
    listed, homes = " ".join(TOPICS.values()).split(), _homes()
    if sorted(listed) != sorted(homes):
        raise SystemExit(f"TOPICS and the public names differ: {set(listed) ^ set(homes)}")


def _homes() -> dict[str, str]:
    """Return the module of each public name."""
    import airlight

    # The stub lists what is public; values are imported when somebody asks for them.
    stub = ast.parse(Path(airlight.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    return {name.name: f"airlight.{line.module}" for line in lines for name in line.names}


def _public(name: str) -> Any:
    import airlight

    return getattr(airlight, name)


def _heading(name: str, value: Any) -> str:
    # A function and its result may have one name but for the capital: headings tell them apart.
    return f"class {name}" if inspect.isclass(value) else name


def _row(name: str) -> tuple[str, str]:
    value = _public(name)
    anchor = _heading(name, value).lower().replace(" ", "-")
    paragraph = _what(name, value).split("\n\n")[0]
    return f"[`{name}`](#{anchor})", " ".join(paragraph.split()).replace("|", "\\|")


def _what(name: str, value: Any) -> str:
    """Return the documentation of a name; of a table, the comment `#:` above it."""
    if callable(value):
        return inspect.getdoc(value) or ""
    lines = inspect.getsource(importlib.import_module(_homes()[name])).splitlines()
    at = next(n for n, line in enumerate(lines) if re.match(rf"{name}\b.* = ", line))
    start = at
    while lines[start - 1].startswith("#:"):
        start -= 1
    return " ".join(line[2:].strip() for line in lines[start:at])


def _entry(name: str, value: Any) -> str:
    parts = [f"### {_heading(name, value)}"]
    if signature := _signature(name, value):
        parts.append(f"```text\nairlight.{signature}\n```")
    parts.append(_markdown(_what(name, value)))
    if inspect.isclass(value):
        parts.append("\n".join(_members(value)))
    return "\n\n".join(part for part in parts if part)


def _signature(name: str, value: Any) -> str:
    """Return the call of a function without types, which the words give; nothing of a result."""
    if not inspect.isfunction(value):
        return ""
    signature = inspect.signature(value)
    bare = [
        each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()
    ]
    short = signature.replace(parameters=bare, return_annotation=inspect.Signature.empty)
    return f"{name}{short}"


def _members(value: type) -> Iterator[str]:
    """Yield a line for each field, property and method that a class documents itself; those of
    all results stand at `Result`.
    """
    if is_dataclass(value):
        meanings = records.meanings(value) if any(f.metadata for f in fields(value)) else {}
        for name, words in (_commented(value) | {k: v for k, v in meanings.items() if v}).items():
            yield f"- `{name}`: {words}"
    for name, member in vars(value).items():
        if value is not Result and hasattr(Result, name):
            continue
        if name.startswith("_") or not _own(member) or not (words := inspect.getdoc(member)):
            continue
        call = ""
        if inspect.isfunction(member):
            call = f"({', '.join([*inspect.signature(member).parameters][1:])})"
        # Its parameters and its refusals, in lists within the list.
        pieces = _SECTION.split(words)
        yield f"- `{name}{call}`: {' '.join(pieces[0].split())}"
        yield from (indent(_entries(text), "  ") for text in pieces[2::2])


def _commented(value: type) -> dict[str, str]:
    """Return the comments `#:` of the fields of a class: those above each, or behind it."""
    found, above = {}, []
    for line in inspect.getsource(value).splitlines():
        if line.strip().startswith("#:"):
            above.append(line.strip()[2:].strip())
            continue
        match = re.match(r"    (\w+): [^#]*(?:#: (.*))?$", line)
        if match and (words := " ".join([*above, match[2] or ""]).strip()):
            found[match[1]] = words
        above = []
    return found


def _own(member: Any) -> bool:
    """Return whether a member has words of its own: a value has those of its type."""
    return inspect.isfunction(member) or type(member).__name__ in ("property", "cached_property")


_SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)


def _markdown(words: str) -> str:
    """Return a docstring with sections, as numpydoc has them, as Markdown."""
    pieces = _SECTION.split(words)
    parts = [pieces[0].strip()]
    # A piece of text follows each heading.
    for heading, text in zip(pieces[1::2], pieces[2::2], strict=True):
        if heading == "Examples":
            parts.append(f"```python\n{text.strip()}\n```")
        else:
            parts.append(f"**{heading}**\n\n{_entries(text)}")
    return "\n\n".join(part for part in parts if part)


def _entries(text: str) -> str:
    """Return the entries of a section as a list."""
    shown = []
    for block in re.split(r"\n(?=\S)", text.strip("\n")):
        head, _, body = block.partition("\n")
        name = f"`{head}`" if re.fullmatch(r"[\w*., ]+", head) else head
        shown.append(f"- {name}: {' '.join(dedent(body).split())}")
    return "\n".join(shown)
