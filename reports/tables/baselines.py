# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight baselines` prints."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from reports.tables.terminal import number, print_words
from validation.frames.baseline_files import Baseline, Move, changelog_line


def print_moves(found: Mapping[str, Baseline], moves: Mapping[str, Sequence[Move]], stray: Sequence[str]) -> None:
    """Print what moved, and a line for each scene."""
    rows = [
        (one.scene, one.label, one.what, number(one.old, 6), number(one.new, 6), number(one.allowed, 2))
        for changed in moves.values()
        for one in changed
    ]
    if rows:
        print_words(rows, ("scene", "configuration", "what", "baseline", "now", "allowed"))
    for name, data in found.items():
        print(f"{name}: {len(data['configurations'])} configurations, {len(moves[name])} moved")
    for name in stray:
        print(f"{name}: a baseline without its scene: remove the file")


def print_updates(written: Sequence[Baseline], folder: Path) -> None:
    """Say what was written, and the lines that the changelog must hold."""
    if not written:
        print("nothing moved, nothing written")
        return
    print(f"written to {folder}: {', '.join(one['scene'] for one in written)}")
    lines = [changelog_line(one) for one in written if one["revision"] > 1]
    if lines:
        print("say so in CHANGELOG.md, with the numbers above; a test looks for these lines:")
        print("\n".join(f"- {line}" for line in lines))
