# SPDX-License-Identifier: BSD-3-Clause
"""Of a folder of scene files each is taken, with its notes, or refused with the words that it is refused with alone."""

import pytest

from analytic.errors import InputError
from reports.interchange.folder import describe_folder

LOOK = '<transform name="to_world"><lookat origin="0.2, -4.1, 1.3" target="0.1, 0, 0.6" up="0, 0, 1"/></transform>'
SCENE = f"""<scene version="3.0.0"><medium type="homogeneous" id="mist">{{}}</medium>
<sensor type="perspective">{LOOK}<ref name="medium" id="mist"/></sensor>{{}}</scene>"""
COEFFICIENTS = '<float name="sigma_t" value="0.23"/><float name="albedo" value="0.83"/>'
OLD = '<float name="sigma_s" value="0.3"/><float name="sigma_a" value="0.1"/>'
LAMP = '<emitter type="point"><point name="position" value="0.7, 0.3, 1.9"/></emitter>'


def test_each_file_has_its_outcome(variant, tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "good.xml").write_text(SCENE.format(COEFFICIENTS, LAMP))
    (tmp_path / "old" / "mist.xml").write_text(SCENE.format(OLD, LAMP))
    (tmp_path / "projector.xml").write_text(SCENE.format(COEFFICIENTS, LAMP.replace("point", "projector", 1)))
    (tmp_path / "torn.xml").write_text("<scene")
    log = describe_folder(tmp_path)
    found = {each.file: each for each in log.of}
    outcomes = {name: each.outcome for name, each in found.items()}
    assert outcomes == {"good.xml": "taken", "old/mist.xml": "taken", "projector.xml": "refused", "torn.xml": "refused"}
    assert found["good.xml"].words == ""
    assert "sigma_t 0.4 and albedo 0.75" in found["old/mist.xml"].words
    assert "projector" in found["projector.xml"].words
    assert log.tables[0].title == "4 scene files: 2 taken, 2 refused"


def test_a_folder_without_scenes_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"holds no \.xml file"):
        describe_folder(tmp_path)
