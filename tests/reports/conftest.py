# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of pages share: a real browser."""

import pytest

from tests.helpers.browser import chromium


@pytest.fixture(scope="module")
def browser():
    with chromium() as launched:
        yield launched
