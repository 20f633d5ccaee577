# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the strip of Fig. 5.8 of Ali 2016 is drawn from its files alone, each picture with its error and time."""

import numpy as np

from reference.storage.exr import Image, write_exr
from reports.figures import shafts_strip
from reports.figures.files import write_data


def test_pictures_stand_in_their_order_with_error_and_time(tmp_path):
    header = ("file", "label", "error", "ms", "exposure")
    rows = [(f"shafts-strip-{number}.exr", f"R{number}", 0.1234, 56.7, 0.5) for number in range(1, 6)]
    rows.append(("shafts-strip-6.exr", "truth", None, None, 0.5))
    for number, row in enumerate(rows):
        write_exr(tmp_path / row[0], Image({"total": np.full((4, 6, 3), 0.3 * number, np.float32)}))
    write_data(tmp_path, "shafts-strip", header, rows)
    panels = shafts_strip.draw(tmp_path, "single").axes
    assert [panel.get_title() for panel in panels] == [
        *(f"R{number}\nerror 0.123, 57 ms" for number in range(1, 6)),
        "truth",
    ]
    shown = [np.asarray(panel.images[0].get_array()) for panel in panels]
    assert [picture.shape for picture in shown] == [(4, 6, 3)] * 6
    levels = [int(picture.max()) for picture in shown]
    assert levels == sorted(set(levels))
    assert all(not panel.xaxis.get_ticklocs().size for panel in panels)
