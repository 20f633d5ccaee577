# SPDX-License-Identifier: BSD-3-Clause
"""`airlight render SCENE`: a frame by a real-time method, with what it costs."""

from pathlib import Path
from typing import Annotated

import typer

Scene = Annotated[str, typer.Argument(help="A built-in scene or a Mitsuba XML file.", show_default=False)]
Size = Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the scene's own by default.")]


def render(
    scene: Scene,
    method: Annotated[str, typer.Option(help="Real-time method, see `airlight methods`.")] = "ray-march",
    kernel: Annotated[str | None, typer.Option(help="Airlight kernel, see `airlight kernels`.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE, a parameter of the method.")] = None,
    size: Size = None,
    precision: Annotated[str, typer.Option(help="single or double.")] = "single",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write layered EXR here.")] = None,
    preview: Annotated[Path | None, typer.Option(help="Write a PNG picture here.")] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Print what the scene needs of a method, and stop.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print times as JSON.")] = False,
) -> None:
    """Render a frame with a real-time method and print what it costs."""
    from realtime.plan import describe
    from realtime.scene import read_scene
    from reference.files import ensure_writable
    from reports.bench_tables import rate
    from reports.environment import activate
    from reports.tables import print_json
    from validation.configurations import configuration, parse_settings
    from validation.load import load_scene, parse_size

    chosen = configuration(method, kernel, parse_settings(set_ or []))
    for path in (output, preview):
        if path is not None:
            ensure_writable(path)
    variant = activate()
    loaded = load_scene(scene, parse_size(size) if size else None)
    read = read_scene(loaded.scene, precision)
    if plan:
        words = describe(read.plan)
        if json:
            print_json({"plan": words, "notes": list(read.plan.notes)})
        else:
            print("\n".join([f"{name}: {value}" for name, value in words.items()] + list(read.plan.notes)))
        return
    times = _render(loaded.name, read, chosen, output=output, preview=preview)
    times |= {"device": variant}
    if json:
        print_json(times)
    else:
        stages = ", ".join(f"{stage['name']} {stage['ms']:.3g} ms" for stage in times["stages"])
        print(f"{loaded.name}, {chosen.label}: {times['frame_ms']:.3g} ms a frame ({rate(times['frame_ms'])} frames/s)")
        print(
            f"  {stages}; {times['rebuild_ms']:.3g} ms with everything rebuilt; {variant}, {times['threads']} threads"
        )


def _render(name: str, scene, chosen, *, output: Path | None, preview: Path | None) -> dict:
    import drjit as dr

    from realtime.frame import render_frame
    from validation.configurations import prepared
    from validation.timing import time_frame

    renderer = prepared(scene, chosen)
    frame = render_frame(renderer)
    if output is not None:
        from reference.exr import write_exr
        from reports.environment import stamped
        from validation.references import layered_frame

        write_exr(output, stamped(layered_frame(name, chosen, frame)))
    if preview is not None:
        from reports.pictures import exposure, tone_mapped, write_png

        total = frame.airlight + frame.surface
        write_png(preview, tone_mapped(total, exposure(total)))
    times = time_frame(renderer)
    return {
        "scene": name,
        "method": chosen.label,
        "size": [scene.camera.width, scene.camera.height],
        "frame_ms": times.frame.median_ms,
        "fps": 1000 / times.frame.median_ms,
        "stages": [
            {"name": "surface", "ms": times.surface.median_ms},
            {"name": "airlight", "ms": times.airlight.median_ms},
        ],
        "rebuild_ms": times.rebuild.median_ms,
        "threads": dr.thread_count(),
    }
