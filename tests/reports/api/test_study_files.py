# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report and a sweep measure what their study says, or refuse it."""

import pytest

from airlight.errors import InputError
from airlight.reports.api.report import _study_of
from airlight.reports.api.sweep import sweep


@pytest.mark.parametrize(
    ("line", "dropped"),
    [
        ('sizes = ["16x12", "32x24"]', "got sizes, but"),
        ('media = [{ "medium.sigma_t" = 0.17 }]', "got media, but"),
        ("limit = 7", "got limit, but"),
        ("retries = 1", "got retries, but"),
        ('times = "alone"\ntimed = 3', "got timed, but"),
        ("media = [{}]", None),
        (
            'growth = ["size"]',
            "got growth, which is timed in colonnade alone: add it to the scenes",
        ),
        ("seconds = 2", "got seconds of times = 'stages', and times = 'with'"),
        ('slow = 0.1\ntimes = "alone"', "got slow of times = 'stages', and times = 'alone'"),
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


@pytest.mark.parametrize(
    ("lines", "dropped"),
    [
        ('half = ["open-fog"]', "half"),
        ("points = 4", "points"),
        ("[checks]\nbatches = 64", "checks"),
        ('growth = ["size"]', "growth"),
        ("stability = 100", "stability"),
        ('times = "stages"', "times = 'stages'"),
        ('timed_size = "800x600"', "timed_size"),
        ("seconds = 2", "seconds"),
        ("slow = 0.04", "slow"),
    ],
)
def test_what_a_sweep_would_drop_is_refused(tmp_path, monkeypatch, lines, dropped):
    """The rows were those of a study without it."""
    pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "study.toml"
    path.write_text(f'scenes = ["open-fog"]\n{lines}\n')
    with pytest.raises(InputError, match=f"got {dropped}, but"):
        sweep(path)
    assert list(tmp_path.iterdir()) == [path]
