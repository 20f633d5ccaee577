# SPDX-License-Identifier: BSD-3-Clause
"""Claim: keys and results change with what decides the numbers alone; a row has every
column and finite numbers.
"""

import math
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.validation.metrics.errors import Metrics
from airlight.validation.scenes.names import random_name, random_parts
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.keys import Made, cell_key, scene_identities
from airlight.validation.study.row import COLUMNS, arrow_schema, property_names, row_values
from airlight.validation.study.run import cell_row
from airlight.validation.study.study import Cell, Measure

CELL = Cell("windows", (32, 24), (), Configuration("ray-march", None, (("steps", 4), ("map", 64))))
MADE = Made("1.0", "ab", (("mitsuba", "3.9.1"),), "llvm_ad_rgb", "3.11.7")

SCENE = """<scene version="3.0.0">
    <path value="meshes"/>
    <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.31"/></medium>
    <emitter type="point"><rgb name="intensity" value="5, 4, 3"/></emitter>
    <sensor type="perspective"><ref name="medium" id="fog"/></sensor>
    <shape type="ply"><string name="filename" value="a.ply"/></shape>
</scene>"""


def test_what_decides_the_numbers_is_in_the_key():
    others = [
        replace(CELL, scene="hall"),
        replace(CELL, size=(32, 25)),
        replace(CELL, medium=("medium.sigma_t=0.1",)),
        replace(CELL, chosen=Configuration("ray-march", None, (("steps", 5), ("map", 64)))),
        replace(CELL, chosen=Configuration("ray-march", "exact", CELL.chosen.parameters)),
        replace(CELL, measure=Measure(flip=True)),
        replace(CELL, measure=Measure("none")),
    ]
    made = [
        replace(MADE, source="ac"),
        replace(MADE, packages=(("mitsuba", "3.9.2"),)),
        replace(MADE, variant="cuda_ad_rgb"),
    ]
    keys = [
        cell_key(CELL, MADE),
        *(cell_key(cell, MADE) for cell in others),
        *(cell_key(CELL, each) for each in made),
    ]
    assert len(set(keys)) == len(keys) == 11


def test_what_does_not_is_not():
    turned = replace(CELL, chosen=Configuration("ray-march", None, (("map", 64), ("steps", 4))))
    assert (
        cell_key(turned, MADE)
        == cell_key(CELL, MADE)
        == cell_key(CELL, replace(MADE, airlight="1.1", python="3.11.9"))
    )


def test_a_file_is_its_content_and_that_of_its_meshes(variant, tmp_path):
    path, mesh = tmp_path / "a.xml", tmp_path / "meshes" / "a.ply"
    mesh.parent.mkdir()
    mi.load_dict({"type": "cube"}).write_ply(str(mesh))
    path.write_text(SCENE)
    cell = replace(CELL, scene=str(path))
    first = cell_key(cell, MADE)
    assert cell_key(cell, MADE, scene_identities([str(path), "windows"])) == first
    path.write_text(SCENE.replace("<shape", "<!-- a box -->  <shape"))
    assert cell_key(cell, MADE) == first
    path.write_text(SCENE.replace("0.31", "0.32"))
    second = cell_key(cell, MADE)
    mi.load_dict({"type": "rectangle"}).write_ply(str(mesh))
    assert len({first, second, cell_key(cell, MADE)}) == 3


def test_a_random_scene_is_its_seed_and_the_content_of_its_files(tmp_path):
    """On any path: colons, spaces, commas, per cent signs."""
    folder = tmp_path / "C:my, 5% meshes"
    folder.mkdir()
    (folder / "a.ply").write_bytes(b"1")
    (folder / "ranges.toml").write_text('meshes = "."')
    name = random_name(7, folder / "ranges.toml")
    assert random_parts(name) == (7, folder / "ranges.toml")
    cells = [replace(CELL, scene=scene) for scene in ("random:7", "random:8", name)]
    keys = [cell_key(cell, MADE) for cell in cells]
    (folder / "a.ply").write_bytes(b"22")
    keys.append(cell_key(cells[2], MADE))
    assert len(set(keys)) == 4


def test_a_users_code_is_in_the_key(tmp_path):
    """The method's and the kernel's; `tests/reference/storage/test_code.py` says
    which modules count with it.
    """
    own = tmp_path / "fog_kernel.py"
    for chosen in (
        Configuration("shadow-planes", f"{own}:kernel"),
        Configuration(f"{own}:kernel", "exact"),
    ):
        keys = []
        for factor in (2, 2, 3):
            own.write_text(f"def kernel(x):\n    return {factor} * x\n")
            keys.append(cell_key(replace(CELL, chosen=chosen), MADE))
        assert keys[0] == keys[1] != keys[2]
    gone = replace(CELL, chosen=Configuration("gone:f"))
    assert cell_key(gone, MADE) != cell_key(gone, MADE)  # what has no file is computed again


MARCHED = Cell(
    "random:7", (16, 12), ("medium.sigma_t=0.1",), Configuration("ray-march", None, (("steps", 4),))
)


def test_a_row_has_every_column_and_no_number_that_is_none():
    error = Metrics(192, 0.1, math.nan, 0.2, np.float32(0.5), 0.1, 0.2, math.inf, 3, 0)
    row = row_values(replace(cell_row(MARCHED, key="a", error=error), properties={"depth": 2}))
    assert list(row) == [*(each.key for each in COLUMNS), "properties.depth"]
    assert [
        row[f"error.{name}"] for name in ("pixels", "relative_bias", "relative_rmse", "max")
    ] == [
        192,
        None,
        0.5,
        None,
    ]
    assert (row["scene"], row["seed"], row["medium"], row["parameters"]) == (
        "random:7",
        7,
        "medium.sigma_t=0.1",
        '{"steps": 4}',
    )
    assert (row["status"], row["times.frame.median_ms"], row["published.psnr"]) == (
        "done",
        None,
        None,
    )
    assert row["command"] == (
        "airlight view random:7 --method ray-march --set steps=4 --change medium.sigma_t=0.1 "
        "--size 16x12"
    )


def test_a_parquet_holds_rows_with_units_and_meanings():
    pa = pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")
    row = row_values(replace(cell_row(MARCHED, key="a"), properties={"depth": 2}))
    schema = arrow_schema(property_names([row]))
    table = pa.Table.from_pylist([row], schema=schema)
    assert table.to_pylist() == [row | {"properties.depth": 2.0}]
    about = schema.field("error.bias").metadata
    assert about == {b"unit": b"W/(m^2 sr)", b"meaning": b"mean error"}
    assert all(each.meaning for each in COLUMNS)
