# SPDX-License-Identifier: BSD-3-Clause
"""The constants of octaves that fit scenes of clouds best."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Row, Table, numbers, table, words

_SHARE = {"digits": 3, "share": True}
COLUMNS = (
    *words(scene="scene", which="constants"),
    *numbers(extinction="extinction a", contribution="contribution b", anisotropy="anisotropy c", how={"digits": 3}),
    *numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", noise="noise of the truth", how=_SHARE),
)


def octave_table(fits: Iterable[Mapping[str, Any]]) -> Table:
    """Return the fits of `airlight bench --fit-octaves --json`, two rows each: halved and fitted constants."""
    rows = [
        Row({"scene": fit["scene"] if which == "halved" else "", "which": which, "noise": fit["noise"]} | fit[which])
        for fit in fits
        for which in ("halved", "fitted")
    ]
    return table("cloud-octaves: the airlight against the truth, by its constants", COLUMNS, rows)
