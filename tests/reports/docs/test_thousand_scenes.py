# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the page of the thousand scenes says what the rows in the repository say."""

import pytest

from reports.docs.thousand_scenes import PAGE, ROOT, current_page

pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")


def test_the_page_is_made_of_the_rows():
    """Run `python -m reports.docs.thousand_scenes` if this fails."""
    assert (ROOT / PAGE).read_text(encoding="utf-8") == current_page()
