# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report measures what its study says, or refuses it."""

import pytest

from airlight.errors import InputError
from airlight.reports.api.report import _study_of


@pytest.mark.parametrize(
    ("line", "dropped"),
    [
        ('sizes = ["16x12", "32x24"]', "got sizes, but"),
        ('media = [{ "medium.sigma_t" = 0.17 }]', "got media, but"),
        ("media = [{}]", None),
    ],
)
def test_what_a_report_would_drop_is_refused(tmp_path, line, dropped):
    """The report showed the scene's own medium where the study asked for another one."""
    path = tmp_path / "study.toml"
    path.write_text(f'scenes = ["open-fog"]\n{line}\n')
    if dropped is None:
        assert _study_of(path).scenes == ("open-fog",)
        return
    with pytest.raises(InputError, match=dropped):
        _study_of(path)
