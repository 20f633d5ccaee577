# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a study is every combination of what its file names, and every mistake in it is refused by name."""

import pytest

from analytic.errors import InputError
from realtime.methods.registry import METHODS
from validation.study.study import default_configurations, default_study, map_side, parse_study, read_study

SCENES = {"scenes": ["sphere-spot", "windows"]}


def test_every_combination_is_a_cell():
    study = parse_study(
        SCENES
        | {
            "sizes": ["32x24", "16x12"],
            "methods": ["ray-march", "light-volumes", "shadow-planes"],
            "kernels": ["exact", "taylor"],
            "maps": [64, 128],
            "media": [{}, {"medium.sigma_t": 0.17}],
            "parameters": {"ray-march": {"steps": [4, 9], "shadow": ["ray", "map"]}},
        }
    )
    labels = {chosen.label for chosen in study.configurations}
    assert "ray-march (steps=4, shadow=ray)" in labels  # without a map, whose size it does not know
    assert {
        "light-volumes (taylor, map=128)",
        "shadow-planes (taylor)",
        "ray-march (steps=9, shadow=map, map=64)",
    } <= labels
    assert len(study.configurations) == 2 * (1 + 2) + 2 * 2 + 2
    images = list(study.images())
    assert len(images) == 2 * 2 * 2
    cells = [cell for image in images for cell in image]
    assert len(set(cells)) == len(cells) == study.scene_count * study.cells_by_scene
    assert all(len({cell.image for cell in image}) == 1 for image in images)
    assert {cell.medium for cell in cells} == {(), ("medium.sigma_t=0.17",)}


def test_without_a_file_every_method_of_fog_runs_at_160_by_120():
    study = default_study(100)
    assert list(study.scene_names())[::99] == ["random:0", "random:99"]
    assert study.sizes == ((160, 120),)
    fog = {name for name, record in METHODS.items() if not record.renders_clouds}
    assert {chosen.method for chosen in default_configurations()} == fog
    assert [map_side(chosen) for chosen in study.configurations if chosen.method == "unshadowed"] == [None]


def test_a_file_with_its_own_scenes_and_fewer_random_ones(tmp_path):
    (tmp_path / "hall.xml").write_text("<scene/>")
    (tmp_path / "study.toml").write_text('scenes = ["hall.xml", "random:7"]\n[random]\ncount = 9\nfirst = 3\n')
    study = read_study(tmp_path / "study.toml", count=2)
    assert study.name == "study"
    assert list(study.scene_names()) == [str(tmp_path / "hall.xml"), "random:7", "random:3", "random:4"]


@pytest.mark.claim("sweep-studies", tolerance="none")
@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"scenes": ["spere-spot"]}, "'spere-spot', wanted .* did you mean 'sphere-spot'"),
        ({"scenes": ["cumulus"]}, "cumulus scatters light many times"),
        ({"scenes": ["windows", "windows"]}, "scenes: 'windows' is there twice"),
        ({"sceens": ["windows"]}, "got sceens, wanted one of .* did you mean 'scenes'"),
        ({"methods": ["unshadowed"], "kernels": ["exakt"]}, "exakt"),
        ({"methods": ["froxel-fog"], "kernels": ["exact"]}, "kernels: none of the methods calls one"),
        ({"methods": ["ray-march"], "parameters": {"ray-march": {"stepz": 3}}}, "stepz.*steps"),
        ({"methods": ["light-volumes"], "maps": [64], "parameters": {"light-volumes": {"map": 3}}}, "give one of them"),
        ({"media": [{"light.intensity": 3}]}, "media: got 'light.intensity', wanted medium.sigma_t"),
        ({"timed": 3}, 'timed: it is of times = "alone", got times = "with"'),
    ],
)
def test_mistakes_are_refused_by_name(data, message):
    with pytest.raises(InputError, match=message):
        parse_study(data)
