# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a key changes with everything that decides the numbers of a cell, and with nothing else."""

from dataclasses import replace

from validation.configurations.methods import Configuration
from validation.sweep.keys import Made, cell_key, made_here, scene_identities, source_digest
from validation.sweep.study import Cell

CELL = Cell("windows", (32, 24), (), Configuration("ray-march", None, (("steps", 4), ("map", 64))))
MADE = Made("1.0", "ab", (("mitsuba", "3.9.1"),), "llvm_ad_rgb", "3.11.7")


def test_what_decides_the_numbers_is_in_the_key():
    others = [
        replace(CELL, scene="hall"),
        replace(CELL, size=(32, 25)),
        replace(CELL, medium=("medium.sigma_t=0.1",)),
        replace(CELL, chosen=Configuration("ray-march", None, (("steps", 5), ("map", 64)))),
        replace(CELL, chosen=Configuration("ray-march", "exact", CELL.chosen.parameters)),
        replace(CELL, flip=True),
        replace(CELL, times="none"),
    ]
    made = [
        replace(MADE, airlight="1.1"),
        replace(MADE, source="ac"),
        replace(MADE, packages=(("mitsuba", "3.9.2"),)),
        replace(MADE, variant="cuda_ad_rgb"),
    ]
    keys = [cell_key(CELL, MADE), *(cell_key(cell, MADE) for cell in others), *(cell_key(CELL, each) for each in made)]
    assert len(set(keys)) == len(keys) == 12
    assert all(len(key) == 64 for key in keys)


def test_what_does_not_is_not():
    turned = replace(CELL, chosen=Configuration("ray-march", None, (("map", 64), ("steps", 4))))
    assert cell_key(turned, MADE) == cell_key(CELL, MADE) == cell_key(CELL, replace(MADE, python="3.12.1"))


def test_a_file_is_its_bytes_and_those_of_its_meshes(tmp_path):
    scene, mesh = tmp_path / "a.xml", tmp_path / "a.ply"
    scene.write_text('<scene><string name="filename" value="a.ply"/></scene>')
    mesh.write_bytes(b"1")
    cell = replace(CELL, scene=str(scene))
    first = cell_key(cell, MADE)
    assert cell_key(cell, MADE, scene_identities([str(scene), "windows"])) == first
    mesh.write_bytes(b"2")
    second = cell_key(cell, MADE)
    scene.write_text('<scene> <string name="filename" value="a.ply"/></scene>')
    assert len({first, second, cell_key(cell, MADE)}) == 3


def test_workers_are_told_apart_by_name():
    theirs = replace(MADE, airlight="0.9", packages=(("mitsuba", "3.9.0"),), python="3.12")
    assert MADE.differences(theirs) == ["airlight 0.9, not 1.0", "mitsuba 3.9.0, not 3.9.1"]
    assert MADE.differences(replace(MADE, python="3.12")) == []
    assert made_here("1.0", "llvm_ad_rgb").source == source_digest()
