# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight bench --stages` does: the stages of collectors for clouds."""

from typing import Any


def bench_stages(scenes: list[str] | None, *, size: str | None, settings, json: bool, markdown: bool) -> None:
    """Print the times of the stages of `cloud-collectors`, and how many of its searches have not converged."""
    from dataclasses import asdict

    from realtime.scene.read_scene import read_scene
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_notes, print_tables
    from reports.machine.progress import counted, part_of, progress_bar
    from reports.tables.cloud_stages import cloud_stages_tables
    from reports.tables.terminal import print_json
    from validation.configurations.methods import configuration, parse_settings
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene, parse_size

    names = scenes or ["stratocumulus"]
    parameters = dict(configuration("cloud-collectors", None, parse_settings(settings or [])).parameters)
    pixels = parse_size(size) if size else None
    activate()
    from validation.frames.cloud_stages import cloud_stages

    records: list[dict[str, Any]] = []
    with progress_bar("bench --stages") as progress:
        for number, name in enumerate(names):
            loaded = load_scene(name, pixels)
            scene = read_scene(loaded.scene)
            print_notes(scene.features.notes)
            part = part_of(progress, number / len(names), (number + 1) / len(names))
            found = cloud_stages(scene, parameters, progress=counted(part))
            at = [scene.camera.width, scene.camera.height]
            records.append({"scene": loaded.name, "size": at} | plain(asdict(found)))
    if json:
        print_json({"environment": describe_environment(), "stages": records})
        return
    if markdown:
        print_heading()
    print_tables([each for record in records for each in cloud_stages_tables(record)], as_markdown=markdown)
