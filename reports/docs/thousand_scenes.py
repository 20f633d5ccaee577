# SPDX-License-Identifier: BSD-3-Clause
"""The page of the thousand scenes: the digest of the rows that are kept in `validation/baselines/thousand`.

A test fails where the page is not what `python -m reports.docs.thousand_scenes` makes it.
"""

from pathlib import Path

from reports.docs.marked import with_part

ROOT = Path(__file__).resolve().parents[2]
PAGE, ROWS = "docs/thousand-scenes.md", "validation/baselines/thousand"


def current_page(root: Path = ROOT) -> str:
    """Return what the page should hold: what stands outside of the marked part is kept."""
    from reports.sweep.digest import digest
    from reports.sweep.read import read_sweep
    from reports.sweep.summary import summary_of

    said = digest(summary_of(read_sweep(root / ROWS)))
    return with_part((root / PAGE).read_text(encoding="utf-8"), "digest", f"\n{said}\n")


def redraw(root: Path = ROOT) -> Path:
    """Write the page anew, and return its path."""
    from reference.storage.files import write_text

    write_text(root / PAGE, current_page(root))
    return root / PAGE


if __name__ == "__main__":
    print(redraw())
