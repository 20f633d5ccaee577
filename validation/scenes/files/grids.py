# SPDX-License-Identifier: BSD-3-Clause
"""Grid volumes of files of OpenVDB, made into grid volumes of Mitsuba."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi

from airlight.validation.scenes.files.nodes import properties, used
from airlight.validation.scenes.vdb import ENDINGS, read_vdb

_NAME = "grid_name"  # the property that names one of several grids of a file


def give_grids(state: mi.parser.ParserState) -> None:
    """Give grid volumes that name a file of OpenVDB its values, and the place that it has.

    A `to_world` of the volume moves the grid from there. Raises InputError for a file that is no
    grid of one density, and MissingError where the package that reads it is not installed.
    """
    for index in used(state):
        props = properties(state, index)
        if props.plugin_name() != "gridvolume" or "filename" not in props:
            continue
        file = str(props["filename"])
        props.mark_queried("filename", False)
        path = Path(str(mi.file_resolver().resolve(file)))
        # A missing file is refused with all others.
        if path.suffix.lower() not in ENDINGS or not path.is_file():
            continue
        grid = read_vdb(path, str(props.get(_NAME, "")))
        place = props.get("to_world", mi.ScalarAffineTransform4d())
        for key in ("filename", "to_world", _NAME):
            if key in props:
                del props[key]
        props["grid"] = mi.VolumeGrid(grid.values[..., None])
        props["to_world"] = place @ mi.ScalarAffineTransform4d(grid.to_world)
