# SPDX-License-Identifier: BSD-3-Clause
import re
from pathlib import Path

import pytest

from realtime.methods.light_volumes import method as light_volumes
from realtime.methods.registry import METHODS

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "light-volumes.md"


@pytest.mark.claim("parameters-of-light-volumes")
def test_every_parameter_is_explained_with_its_values_and_its_default_first():
    section = DOCUMENT.read_text(encoding="utf-8").split("## The parameters")[1].split("`--kernel`")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \|", section, flags=re.MULTILINE)
    explained = {name: values.replace("`", "").split(", ") for name, values in rows}
    defaults = METHODS["light-volumes"].parameters
    assert set(explained) == set(defaults)
    words = {"evaluation": "EVALUATIONS", "tessellation": "TESSELLATIONS", "surface": "SURFACES", "walls": "WALLS"}
    for name, default in defaults.items():
        assert explained[name][0] == str(default), name
        if name in words:
            assert explained[name] == list(getattr(light_volumes, words[name])), name
