# SPDX-License-Identifier: BSD-3-Clause
"""The words of JSON Schema that the schema of report.json uses, so that a user needs no package for them.

Checked are `type`, `const`, `enum`, `required`, `properties`, `additionalProperties` (a schema), `items`, `minItems`,
`maxItems`, `anyOf` and `$ref` into `$defs`: the schema may use no others (a test holds it to that, and to the verdict
of `jsonschema`).
"""

from collections.abc import Iterator, Mapping
from typing import Any

WORDS = {
    "type", "const", "enum", "required", "properties", "additionalProperties",
    "items", "minItems", "maxItems", "anyOf", "$ref",
}  # fmt: skip
SILENT = {"$schema", "$id", "$defs", "title", "description"}  #: words that decide nothing

_TYPES: Mapping[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "null": (type(None),),
}


def first_fault(value: Any, schema: Mapping[str, Any]) -> str | None:
    """Return what is wrong with a piece of JSON, the place and the words; None if nothing is.

    Parameters
    ----------
    value
        As `json.loads` returns it.
    schema
        The schema, with the words of the module alone.
    """
    return next(_faults(value, schema, schema, "report"), None)


def _faults(value: Any, schema: Mapping[str, Any], root: Mapping[str, Any], place: str) -> Iterator[str]:
    if "$ref" in schema:
        yield from _faults(value, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root, place)
    if "anyOf" in schema:
        several = [list(_faults(value, one, root, place)) for one in schema["anyOf"]]
        if all(several):
            # The choice that comes furthest into the value is the one that was meant; the last where several do.
            yield max((one[0] for one in reversed(several)), key=lambda fault: fault.partition(": ")[0].count("."))
    if "const" in schema and value != schema["const"]:
        yield f"{place}: got {value!r}, wanted {schema['const']!r}"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{place}: got {value!r}, wanted one of {', '.join(map(repr, schema['enum']))}"
    if "type" in schema:
        kinds = [schema["type"]] if isinstance(schema["type"], str) else schema["type"]
        if not any(_is(value, kind) for kind in kinds):
            yield f"{place}: got {_short(value)}, wanted {' or '.join(kinds)}"
            return
    if isinstance(value, dict):
        yield from _object_faults(value, schema, root, place)
    elif isinstance(value, list):
        yield from _array_faults(value, schema, root, place)


def _object_faults(value: dict, schema: Mapping[str, Any], root: Mapping[str, Any], place: str) -> Iterator[str]:
    for name in schema.get("required", ()):
        if name not in value:
            yield f"{place}: has no {name!r}"
    properties = schema.get("properties", {})
    for name, one in value.items():
        inner = properties.get(name, schema.get("additionalProperties", {}))
        yield from _faults(one, inner, root, f"{place}.{name}")


def _array_faults(value: list, schema: Mapping[str, Any], root: Mapping[str, Any], place: str) -> Iterator[str]:
    least, most = schema.get("minItems", 0), schema.get("maxItems", len(value))
    if not least <= len(value) <= most:
        yield f"{place}: got {len(value)} entries, wanted {least if least == most else f'{least} to {most}'}"
    for number, one in enumerate(value):
        yield from _faults(one, schema.get("items", {}), root, f"{place}.{number}")


def _is(value: Any, kind: str) -> bool:
    # True is an int to Python, and 3.0 is an integer to JSON Schema.
    if isinstance(value, bool):
        return kind == "boolean"
    if kind == "integer" and isinstance(value, float):
        return value.is_integer()
    return isinstance(value, _TYPES[kind])


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 40 else f"{text[:36]} .."
