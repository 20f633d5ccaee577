# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --fit-octaves`: the constants of cloud-octaves that fit a scene of clouds best."""

from pathlib import Path
from typing import Any

_FIT_SIZE, _FIT_SAMPLES = (160, 120), 512  # of the truth of a fit that is not given


def print_octave_fits(
    scenes: list[str] | None, *, size: str | None, against: Path | None, settings, json: bool, markdown: bool
) -> None:
    """Print the constants of octaves that fit scenes of clouds best."""
    from analytic.errors import InputError
    from reference.storage.exr import read_exr
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.octave_fit import octave_table
    from reports.tables.terminal import print_json
    from validation.configurations.methods import configuration, parse_settings
    from validation.metrics.errors import plain
    from validation.scenes.loading import parse_size
    from validation.scenes.registry import SCENES

    names = scenes or [name for name, record in SCENES.items() if record.clouds]
    if against is not None and len(names) != 1:
        raise InputError(f"--against: got one image for {len(names)} scenes; name its scene")
    if against is not None:
        read_exr(against)  # unreadable files are refused before Mitsuba starts
    parameters = dict(configuration("cloud-octaves", None, parse_settings(settings or [])).parameters)
    pixels = parse_size(size) if size else None
    activate()
    fits = []
    with progress_bar("bench --fit-octaves") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            fits.append(_octave_fit(name, pixels, against, parameters, step))
    if json:
        print_json({"environment": describe_environment(), "fits": plain(fits)})
        return
    if markdown:
        print_heading()
    print_tables([octave_table(plain(fits))], as_markdown=markdown)
    for fit in fits:
        best = " ".join(f"--set {key}={fit['fitted'][key]:.3g}" for key in ("extinction", "contribution", "anisotropy"))
        print(f"{fit['scene']}: airlight render {fit['scene']} --method cloud-octaves {best}")


def _octave_fit(name: str, pixels, against: Path | None, parameters: dict[str, Any], progress) -> dict[str, Any]:
    """Return the fit of one scene, at the size of the truth that is given."""
    from dataclasses import asdict

    from realtime.scene.read_scene import read_scene
    from reference.storage.exr import layer, read_exr
    from reports.machine.printing import print_notes
    from reports.machine.progress import counted, part_of
    from validation.estimates.budget import Budget
    from validation.estimates.images import cloud_orders, monte_carlo_reference
    from validation.frames.octave_fit import fit_octaves
    from validation.scenes.loading import load_scene

    if against is None:
        loaded = load_scene(name, pixels or _FIT_SIZE)
        part = part_of(progress, 0.0, 0.8)
        budget, orders = Budget(samples=_FIT_SAMPLES), cloud_orders("sets")
        image = monte_carlo_reference(loaded, "cloud-paths", budget=budget, orders=orders, progress=part).image
    else:
        image = read_exr(against)
        height, width = layer(image, "airlight", str(against)).shape[:2]
        loaded = load_scene(name, pixels or (width, height))
    scene = read_scene(loaded.scene)
    print_notes(scene.features.notes)
    truth = layer(image, "airlight", str(against or name))
    part = part_of(progress, 0.8 if against is None else 0.0, 1.0)
    error = image.layers.get("airlight_se")
    fit = fit_octaves(scene, truth, standard_error=error, parameters=parameters, progress=counted(part))
    size = [scene.camera.width, scene.camera.height]
    return {"scene": loaded.name, "size": size, "truth": str(against or "cloud-paths")} | asdict(fit)
