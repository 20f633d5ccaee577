# SPDX-License-Identifier: BSD-3-Clause
r"""Grids of OpenVDB as grids of Mitsuba, the same function of the place.

A grid of OpenVDB has values at whole numbers i of its index space, is trilinear between them, and
has its background where no value is stored; its transform takes i to the place s i + t, with a
scale and a translation for each axis. Mitsuba's grid volume of n voxels has values at the centres
of voxels, (j + 1/2)/n of its box, is trilinear between these, constant in the outer half voxels,
and 0 beyond the box.

Let a and b be the least and the largest index with a value. With a layer of the background, which
must be 0, on either side the voxels are j = i - a + 1, so that the box from a - 3/2 to b + 3/2 of the
index space has n = b - a + 3 voxels whose centres are the whole numbers: between the last value and
the first background the function falls to 0 as OpenVDB's, and in the outer half voxel it is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError, require
from airlight.validation.arrays import Array

#: The endings of files of OpenVDB and NanoVDB.
ENDINGS = (".vdb", ".nvdb")
_USUAL = "density"  # the grid that is taken where none is named and there are several
_FLOATS = "Tree_float_"
_MOST = 1 << 28  # voxels of a dense grid, 1 GiB
_MOST_ONE_BY_ONE = 1 << 24  # voxels of NanoVDB, which are asked for one by one: some ten seconds


@dataclass(frozen=True, eq=False)
class DenseGrid:
    """A grid of OpenVDB with all its values, and a layer of its background around them."""

    values: NDArray[np.float32]  #: (z, y, x)
    to_world: Array  #: from the unit cube to its box, (4, 4)


def read_vdb(path: Path, name: str = "") -> DenseGrid:
    """Read a grid of floats from a file of OpenVDB or NanoVDB.

    Parameters
    ----------
    path
        The file, .vdb or .nvdb.
    name
        The grid; by default the one named density, or the only one.

    Raises
    ------
    InputError
        For a file that is no such grid, a grid that is turned or a level set, one whose background
        is not 0, and one that is too large.
    MissingError
        Where the package that reads it is not installed.
    """
    require("tinyvdb", "vdb", "a grid of OpenVDB")
    import tinyvdb

    if path.suffix.lower() == ".nvdb":
        return _read_nanovdb(path, name)
    try:
        with tinyvdb.open(str(path)) as file:
            file.read_grids()
            grids = dict[str, Any]()
            for number in range(file.grid_count):
                grid = file.grid(number)
                grids.setdefault(str(grid.name), grid)
            kinds = {each: str(grid.type_name) for each, grid in grids.items()}
            floats = [each for each, kind in kinds.items() if kind.startswith(_FLOATS)]
            return _dense(grids[_chosen(kinds, floats, name, path)], path)
    except tinyvdb.VDBError as error:
        raise InputError(
            f"grid {path}: it cannot be read as OpenVDB ({error}); expected a file of OpenVDB: "
            "write it again"
        ) from error


def _chosen(kinds: dict[str, str], floats: Sequence[str], name: str, path: Path) -> str:
    """Return the name of the grid to read; `kinds` has all grids, and `floats` those of floats."""
    listed = ", ".join(f"{each} ({kind})" for each, kind in kinds.items()) or "none"
    if name and name not in floats:
        raise InputError(
            f"grid {path}: there is no grid of floats '{name}' in it; expected one of its grids: "
            f"{listed}"
        )
    if not name and _USUAL not in floats and len(floats) != 1:
        raise InputError(
            f"grid {path}: it has no grid of floats named {_USUAL}, and has {listed}; name one: "
            '<string name="grid_name" value="..."/>'
        )
    return name or (_USUAL if _USUAL in floats else floats[0])


def _dense(grid: Any, path: Path) -> DenseGrid:
    where = f"grid {path}: '{grid.name}'"
    if "level set" in str(grid.metadata.get("class", "")):
        raise InputError(
            f"{where} is a level set, a distance and no density; expected a fog volume: convert it"
        )
    background = float(grid.float_background())
    if background != 0:
        raise InputError(
            f"{where} has the background {background:g}, which fills all space; "
            "expected 0: subtract it"
        )
    # Nodes above the leaves, levels 1 and 2, count their tiles, blocks of one value, which the
    # package does not give.
    nodes = map(grid.tree.node, range(grid.tree.num_nodes))
    if any(node.level in (1, 2) and node.active_voxel_count for node in nodes):
        raise InputError(
            f"{where} has tiles, blocks that are stored as one value, which are not read; expected "
            "voxels: write it with its tiles voxelised (voxelizeActiveTiles)"
        )
    box = grid.active_bbox()
    if box is None:
        raise InputError(f"{where} has no values; expected densities")
    # The box of the leaves, whose upper end is exclusive, one voxel larger on each side.
    low = np.array(box[0], dtype=np.int64) - 1
    high = np.array(box[1], dtype=np.int64) + 1
    if np.prod((high - low).astype(float)) > _MOST:
        sides = " x ".join(map(str, high - low))
        raise InputError(
            f"{where} takes {sides} voxels; expected at most {_MOST}: resample it, or clip it"
        )
    dense = grid.materialize_dense(tuple(low.tolist()), tuple(high.tolist()))
    values = np.frombuffer(dense, dtype=np.float32).reshape(*(high - low)[::-1])
    return _placed(values, low, *_transform(grid.transform, where), where)


def _placed(
    values: NDArray[np.float32], low: NDArray[np.int64], scale: Array, moved: Array, where: str
) -> DenseGrid:
    """Return the grid of values, (z, y, x), whose first one has the index `low`, (3,); the outermost
    layers are background.
    """
    # Leaves are mostly empty at their ends: the box shrinks to the values and one layer.
    bounds = [np.flatnonzero(values.any(axis=axes)) for axes in ((0, 1), (0, 2), (1, 2))]
    if not len(bounds[0]):
        raise InputError(f"{where} is 0 everywhere; expected densities")
    first = np.array([each[0] - 1 for each in bounds])
    last = np.array([each[-1] + 2 for each in bounds])
    (x0, y0, z0), (x1, y1, z1) = first, last
    # The corners of the box are half a voxel outside of the outermost centres (see the module).
    matrix = np.diag([*(scale * (last - first)), 1.0])
    matrix[:3, 3] = scale * (low + first - 0.5) + moved
    return DenseGrid(np.ascontiguousarray(values[z0:z1, y0:y1, x0:x1]), matrix)


def _transform(transform: dict[str, Any], where: str) -> tuple[Array, Array]:
    """Return the scales and the translation of a grid, (3,) each [m]."""
    kind = str(transform["type"])
    if kind == "affine":
        # OpenVDB multiplies rows: the translation is the last one.
        matrix = np.array(transform["matrix"], dtype=np.float64)
        scale, moved = np.diag(matrix)[:3], matrix[3, :3]
        straight = np.abs(matrix[:3, :3] - np.diag(scale)).max() <= 1e-9 * np.abs(scale).max()
    else:
        scale, moved = (np.array(transform[key], float) for key in ("scale", "translation"))
        straight = "scale" in kind or "translat" in kind
    if not (straight and np.all(scale)):
        raise InputError(
            f"{where} has a transform of the kind '{kind}', which is turned or no scale and "
            "translation; expected these along the axes: resample it"
        )
    return scale, moved


def _read_nanovdb(path: Path, name: str) -> DenseGrid:
    # The package has the reader, and does not give it a public name.
    from tinyvdb._tinyvdb_nanovdb import NanoVDBFile

    # The header has 16 bytes, then come the sizes of the first grid in memory and in the file: the
    # package reads a file that ends before as zeros.
    with path.open("rb") as stream:
        head = stream.read(32)
    if len(head) < 32 or path.stat().st_size < 16 + int.from_bytes(head[24:], "little"):
        raise InputError(
            f"grid {path}: it cannot be read as NanoVDB, it ends too early; expected a whole file: "
            "copy it again"
        )
    try:
        file = NanoVDBFile(str(path))
    except (RuntimeError, OSError, ValueError) as error:
        raise InputError(
            f"grid {path}: it cannot be read as NanoVDB ({error}); expected a file of NanoVDB: "
            "write it again"
        ) from error
    try:
        kinds = {str(file.grid_name(i)): str(file.grid_type(i)) for i in range(file.grid_count())}
        if not kinds:
            raise InputError(f"grid {path}: it has no grids; expected a file of NanoVDB")
        floats = [each for each, kind in kinds.items() if kind == "Float"]
        chosen = _chosen(kinds, floats, name, path)
        return _dense_nanovdb(file, list(kinds).index(chosen), path)
    finally:
        file.close()


def _dense_nanovdb(file: Any, number: int, path: Path) -> DenseGrid:
    where = f"grid {path}: '{file.grid_name(number)}'"
    if "LevelSet" in str(file.grid_class(number)):
        raise InputError(
            f"{where} is a level set, a distance and no density; expected a fog volume: convert it"
        )
    first, last = (np.array(end, dtype=np.int64) for end in file.bbox(number))
    low, shape = first - 1, last - first + 3
    if np.prod(shape.astype(float)) > _MOST_ONE_BY_ONE:
        sides = " x ".join(map(str, shape))
        raise InputError(
            f"{where} takes {sides} voxels; expected at most {_MOST_ONE_BY_ONE} of NanoVDB: "
            "write it as OpenVDB"
        )
    # The package tells one voxel size and the box in the world, from the first value to one step
    # beyond the last: both agree for a grid of one scale that is not turned.
    ends = np.array(file.world_bbox(number), dtype=np.float64)
    scale = np.diff(ends, axis=0)[0] / (last - first + 1)
    size = float(file.voxel_size(number))
    if not np.allclose(scale, size, rtol=1e-5, atol=0):
        raise InputError(
            f"{where} is turned or has several scales; expected one scale and a translation: "
            "resample it, or write it as OpenVDB"
        )
    far = (first - (1 << 20)).tolist()
    if file.get(number, *far) != 0:
        raise InputError(
            f"{where} has a background, which fills all space; expected 0: subtract it"
        )
    (x, nx), (y, ny), (z, nz) = zip(low.tolist(), shape.tolist(), strict=True)
    values = [
        file.get(number, i, j, k)
        for k in range(z, z + nz)
        for j in range(y, y + ny)
        for i in range(x, x + nx)
    ]
    dense = np.array(values, dtype=np.float32).reshape(nz, ny, nx)
    return _placed(dense, low, scale, ends[0] - scale * first, where)
