# SPDX-License-Identifier: BSD-3-Clause
"""The kit, written once for all its tests."""

import json

import pytest

from airlight.reports.kit.write import write_kit


@pytest.fixture(scope="session")
def kit(variant, tmp_path_factory):
    """The folder of the kit."""
    folder = tmp_path_factory.mktemp("kit")
    write_kit(folder)
    return folder


@pytest.fixture(scope="session")
def rows(kit):
    """The rows of `airlight_kit.json` by group."""
    groups = json.loads((kit / "airlight_kit.json").read_text())["groups"]
    return {group["name"]: group["rows"] for group in groups}
