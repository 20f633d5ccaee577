# SPDX-License-Identifier: BSD-3-Clause
"""The pages list the parameters of methods as the program has them."""

import re
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from realtime.methods.registry import METHODS
from realtime.parameters import limits_of

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.mark.claim("parameters-of-shadow-planes", "parameters-of-light-volumes")
@pytest.mark.parametrize("name", METHODS)
def test_a_page_lists_every_parameter_with_its_values_the_default_first(name, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(DOCS / "_ext"), *sys.path])
    import listed

    assert f"<!-- generated: parameters {name} -->" in (DOCS / f"{name}.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \|$", listed.parameters(name), flags=re.MULTILINE)
    listed_values = {parameter: re.split("[,;] ", values.replace("`", "")) for parameter, values, _ in rows}
    assert list(listed_values) == [item.name for item in fields(METHODS[name].parameters)]
    for item in fields(METHODS[name].parameters):
        values = listed_values[item.name]
        assert values[0] == str(item.default), item.name
        if isinstance(item.default, str) and limits_of(item).choices:
            assert set(values) == set(limits_of(item).choices), item.name
    assert all(words for *_, words in rows)
