# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `--json` prints JSON and nothing else; what Mitsuba says of a scene
reaches the error stream, once.
"""

import json

import pytest

from tests.helpers.scenes import LAMP, scene_xml

HEAD = """ply
format ascii 1.0
element vertex {}
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
"""


@pytest.mark.parametrize(
    "order",
    [
        ["describe"],
        ["render", "--method", "unshadowed", "-o", "frame.exr"],
        ["reference", "-o", "sampled.exr", "--estimator", "single-scatter", "--samples", "64"],
    ],
    ids=lambda order: order[0],
)
def test_json_is_all_that_is_printed(variant, tmp_path, monkeypatch, capfd, order):
    """The mesh is ASCII and long enough that Mitsuba warns of it; it has an isolated
    vertex and an empty triangle.
    """
    from airlight.reports.commands.main import run

    monkeypatch.chdir(tmp_path)
    name = order[0]  # each message is said once a process
    vertices = [
        f"{number * 1e-4:.12f} {number % 7 * 1e-3:.12f} 0.400000000001\n" for number in range(3000)
    ]
    (tmp_path / f"{name}.ply").write_text(
        HEAD.format(3000) + "".join(vertices) + "3 0 1 2\n3 0 0 1\n"
    )
    mesh = f'<shape type="ply"><string name="filename" value="{name}.ply"/></shape>'
    (tmp_path / "own.xml").write_text(scene_xml(LAMP, mesh, mesh, size=(8, 6)))
    status = run([order[0], "own.xml", *order[1:], "--json"])
    printed = capfd.readouterr()
    assert status == 0, printed.err
    assert json.loads(printed.out)
    assert printed.err.count("uses the ASCII PLY format") == 1
