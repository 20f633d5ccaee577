# SPDX-License-Identifier: BSD-3-Clause
import copy
import json

import jsonschema
import pytest

from reports.data.reader import SCHEMA_FILE
from reports.data.schema_check import SILENT, WORDS, first_fault

SCHEMA = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
SMALL = {
    "type": "object",
    "required": ["name", "size"],
    "properties": {
        "name": {"enum": ["a", "b"]},
        "size": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2},
        "value": {"type": ["number", "null"]},
        "inner": {"anyOf": [{"type": "null"}, {"$ref": "#/$defs/inner"}]},
        "by name": {"type": "object", "additionalProperties": {"type": "string"}},
        "version": {"const": 2},
    },
    "$defs": {"inner": {"type": "object", "required": ["x"], "properties": {"x": {"type": "boolean"}}}},
}
RIGHT = {
    "name": "a",
    "size": [4, 3],
    "value": None,
    "inner": {"x": True},
    "by name": {"k": "v"},
    "version": 2,
    "more": [],
}


def words(schema):
    """Return every word of a schema, whatever it is called that is described."""
    found = set(schema)
    for name, value in schema.items():
        if name in ("properties", "$defs"):
            found |= {word for one in value.values() for word in words(one)}
        elif name in ("items", "additionalProperties"):
            found |= words(value)
        elif name == "anyOf":
            found |= {word for one in value for word in words(one)}
    return found


def test_the_schema_uses_only_words_that_are_checked():
    assert words(SCHEMA) <= WORDS | SILENT


def test_what_is_right_has_no_fault():
    jsonschema.validate(RIGHT, SMALL)
    assert first_fault(RIGHT, SMALL) is None


@pytest.mark.claim("report-schema")
@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"name": "c"}, "report.name: got 'c', wanted one of 'a', 'b'"),
        ({"size": [4]}, "report.size: got 1 entries, wanted 2"),
        ({"size": [4, "3"]}, "report.size.1: got '3', wanted integer"),
        ({"size": [4, 3.5]}, "report.size.1: got 3.5, wanted integer"),
        ({"size": [True, 3]}, "report.size.0: got True, wanted integer"),
        ({"value": "much"}, "report.value: got 'much', wanted number or null"),
        ({"value": False}, "report.value: got False, wanted number or null"),
        ({"inner": {}}, "report.inner: has no 'x'"),
        ({"inner": {"x": 1}}, "report.inner.x: got 1, wanted boolean"),
        ({"by name": {"k": 3}}, "report.by name.k: got 3, wanted string"),
        ({"version": 3}, "report.version: got 3, wanted 2"),
    ],
)
def test_a_fault_is_named_and_jsonschema_finds_it_too(change, fault):
    wrong = RIGHT | change
    assert not jsonschema.Draft202012Validator(SMALL).is_valid(wrong)
    assert first_fault(wrong, SMALL) == fault


def test_a_missing_key_and_another_type_are_faults():
    wrong = copy.deepcopy(RIGHT)
    del wrong["size"]
    assert first_fault(wrong, SMALL) == "report: has no 'size'"
    assert first_fault([], SMALL) == "report: got [], wanted object"
    assert first_fault(RIGHT | {"size": [4.0, 3]}, SMALL) is None
