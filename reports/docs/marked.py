# SPDX-License-Identifier: BSD-3-Clause
"""The part of a page between two marks, which a program makes; the rest is written by hand."""


def with_part(text: str, name: str, content: str) -> str:
    """Return a page whose part between `<!-- NAME: begin -->` and `<!-- NAME: end -->` is made anew."""
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, rest = text.split(begin)
    return f"{before}{begin}{content}{end}{rest.split(end)[1]}"
