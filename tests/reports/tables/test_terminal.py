# SPDX-License-Identifier: BSD-3-Clause
"""Tables for a terminal."""

from reports.tables.terminal import print_table, print_words


def test_brackets_are_words(capsys):
    """Units stand in brackets, which rich would take for its own marks and leave out."""
    print_table(("scene", "time [ms]"), [("open-fog [small]", "[red] 3.1")], title="times [ms]")
    print_words([("refused: got [1, 2]", "x [m]")], ("why", "where [m]"))
    text = capsys.readouterr().out
    for words in (
        "time [ms]",
        "open-fog [small]",
        "[red] 3.1",
        "times [ms]",
        "refused: got [1, 2]",
        "x [m]",
        "where [m]",
    ):
        assert words in text
