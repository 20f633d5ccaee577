# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --interpolation`: how many rays an image needs between tiles, and along epipolar lines."""

from pathlib import Path

_SIZE = (1024, 1024)


def print_interpolation(names: list[str] | None, *, size, chosen, json: bool, markdown: bool) -> None:
    """Print how many rays interpolated images need, and by how much these err."""
    from realtime.scene.read_scene import read_scene
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.tables.interpolation import interpolation_tables
    from reports.tables.terminal import print_json
    from validation.frames.interpolation_study import rendered, study_interpolation
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene

    activate()
    width, height = size or _SIZE
    records = []
    for name in names or ["colonnade"]:
        loaded = load_scene(name, (2 * width, 2 * height))
        for configuration in chosen:
            found = study_interpolation(rendered(read_scene(loaded.scene), configuration))
            ways = [plain(each) | {"rays": each.rays} for each in found]
            record = {"scene": Path(name).stem, "size": [width, height], "label": configuration.label, "ways": ways}
            records.append(record)
    if json:
        print_json({"environment": describe_environment(), "interpolation": records})
        return
    if markdown:
        print_heading()
    print_tables(interpolation_tables(records), as_markdown=markdown)
