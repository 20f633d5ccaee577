# SPDX-License-Identifier: BSD-3-Clause
"""Faults that are set in Blender's Cycles, and what the diagnosis says of them:
`docs/data/cycles-faults.json`.

`python docs/tools/cycles_round_trips.py --python PYTHON --images FOLDER` describes scenes, lets an
interpreter with `bpy` render them with faults by `cycles_faults.py`, diagnoses what is in the
folder and writes the answers into the record, from which docs/diagnosed-engines.md is built. Images that
are there are not rendered again.
"""

import argparse
import json
import subprocess
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs/data/cycles-faults.json"
_RENDERER = str(Path(__file__).with_name("cycles_faults.py"))
#: Scenes that are rendered, and how to load them.
SCENES = {
    "sphere-spot": "sphere-spot",
    "open-fog": "open-fog",
    "lobe-fog": "docs/examples/lobe-fog.xml",
}
_SIZE = (160, 120)


def answers(
    name: str, folder: Path, *, python: str | None, samples: int, root: Path = ROOT
) -> Iterator[dict[str, Any]]:
    """Render the missing images of a scene, diagnose all of them, and yield a row for each.

    Parameters
    ----------
    name
        A name in `SCENES`.
    folder
        Folder of its images; `faults.json` next to it lists the injected
        faults, if `python` is None.
    python
        An interpreter that has `bpy`; None: only images that are there are diagnosed.
    samples
        Paths per pixel of the rendered images.
    root
        The checkout.
    """
    from airlight.reference.scene.read import read_reference
    from airlight.validation.engine.diagnose import diagnose_file
    from airlight.validation.engine.prediction import SceneLight
    from airlight.validation.scenes.loading import load_scene

    scene = str(root / SCENES[name]) if SCENES[name].endswith(".xml") else SCENES[name]
    if python is None:
        faults = json.loads((folder.parent / "faults.json").read_text(encoding="utf-8"))
    else:
        faults = _listed(python, root)
        render_faults(python, scene, folder, samples=samples, size=_SIZE, root=root)
    light = SceneLight(read_reference(load_scene(scene, _SIZE).scene))
    for fault, said in faults.items():
        path = folder / f"{fault}.exr"
        if not path.exists():
            continue  # a scene that cannot have it
        (diagnosis,) = diagnose_file(path, scene, pixel="area", light=light)
        first = diagnosis.ranked[0]
        print(
            f"{name}, {fault}: {diagnosis.first}, {diagnosis.residual:.2%}, {diagnosis.left:.2%} "
            "left",
            flush=True,
        )
        yield {
            "scene": name,
            "fault": fault,
            **said,
            "first": diagnosis.first,
            "right": diagnosis.first == said["injected"],
            "says": first.words,
            "together": list(first.together),
            "residual": diagnosis.residual,
            "left": diagnosis.left,
        }


def render_faults(
    python: str,
    scene: str,
    folder: Path,
    *,
    samples: int,
    size: tuple[int, int],
    faults: Sequence[str] | None = None,
    root: Path = ROOT,
) -> None:
    """Render a scene with faults by Cycles, each into FOLDER/FAULT.exr, from its description alone.

    Parameters
    ----------
    python
        An interpreter that has `bpy`.
    scene
        A built-in scene or a Mitsuba XML file.
    folder
        Where the images go; those that are there are kept.
    samples, size
        Paths per pixel; width and height [pixels].
    faults
        Which of `cycles_faults.py --list`; all by default.
    root
        The checkout.
    """
    from airlight.reports.api.explore import Description
    from airlight.reports.interchange.gltf import write_gltf
    from airlight.reports.interchange.scene import describe_scene
    from airlight.validation.scenes.loading import load_scene

    folder.mkdir(parents=True, exist_ok=True)
    loaded = load_scene(scene, size)
    described, gltf = folder / "described.json", folder / "meshes.glb"
    said = Description(described=describe_scene(loaded)).enveloped("airlight describe")
    described.write_text(json.dumps(said), encoding="utf-8")
    write_gltf(gltf, loaded)
    wanted = [
        fault for fault in faults or _listed(python, root) if not (folder / f"{fault}.exr").exists()
    ]
    if wanted:
        options = ["--samples", str(samples), "--faults", *wanted]
        command = [python, _RENDERER, str(described), str(gltf), str(folder), *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def _listed(python: str, root: Path) -> dict[str, Any]:
    command = [python, _RENDERER, "--list"]
    listed: dict[str, Any] = json.loads(
        subprocess.run(command, check=True, capture_output=True, text=True).stdout
    )
    return listed


def main() -> None:
    """Render what is missing, diagnose all images, and write the record."""
    from airlight.reference.storage.files import write_text
    from airlight.reports.machine.environment import activate

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--images", type=Path, required=True, help="folder of images, one folder for each scene"
    )
    parser.add_argument(
        "--python", help="an interpreter that has `bpy`; without it only what is there is diagnosed"
    )
    parser.add_argument("--samples", type=int, default=192, help="paths per pixel")
    parser.add_argument(
        "--scenes", nargs="*", choices=SCENES, default=list(SCENES), help="others keep their rows"
    )
    chosen = parser.parse_args()
    activate()
    for name in chosen.scenes:
        for row in answers(
            name, chosen.images / name, python=chosen.python, samples=chosen.samples
        ):
            kept = json.loads(RECORD.read_text(encoding="utf-8"))["rows"] if RECORD.exists() else []
            rows = [
                each for each in kept if (each["scene"], each["fault"]) != (name, row["fault"])
            ] + [row]
            rows.sort(key=lambda each: list(SCENES).index(each["scene"]))
            record = {"measured": f"{datetime.now(UTC):%Y-%m-%d}", "blender": "5.0.1", "rows": rows}
            write_text(RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
