# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --estimators`: single-scatter and volpath at equal error."""


def print_estimators(scenes: list[str] | None, *, size: str | None, force: bool, json: bool) -> None:
    """Print how long estimators of the truth take to the same error."""
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json
    from validation.estimates.efficiency import efficiency_lines, scene_efficiency, thin_fog
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import FOG_SCENES
    from validation.study.cost import check_work, sampled_work

    pixels = parse_size(size) if size else (160, 120)
    activate()
    names = list(scenes or FOG_SCENES)
    loaded = {name: load_scene(name, pixels).scene for name in names}  # refuses unusable input before any work
    if not scenes:
        loaded = {"open-fog, optical depth 0.2": thin_fog(pixels)} | loaded
    check_work("bench --estimators", [sampled_work(pixels, 1024) for _ in loaded], force=force)
    efficiencies = {}
    with progress_bar("bench") as progress:
        for number, (name, scene) in enumerate(loaded.items()):
            progress(number / len(loaded), name)
            efficiencies[name] = scene_efficiency(scene)
    if json:
        from validation.metrics.errors import plain

        print_json({"environment": describe_environment(), "estimators": plain(efficiencies)})
        return
    for name, efficiency in efficiencies.items():
        print(f"{name}, {pixels[0]} x {pixels[1]}")
        print("\n".join(f"  {line}" for line in efficiency_lines(efficiency)))
