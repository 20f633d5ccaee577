# SPDX-License-Identifier: BSD-3-Clause
"""Render a scene of airlight by LuxCore, from what `airlight describe` says of it and nothing else.

    airlight describe open-fog --size 160x120 --json -o open-fog.glb > open-fog.json
    python render_luxcore.py open-fog.json open-fog.glb open-fog.exr --samples 4096
    airlight compare open-fog open-fog.exr

The interpreter needs the packages `pyluxcore` and `numpy`. Rendered with pyluxcore 2.11.2. Its
media have Schlick's phase function alone, and its spots shine by 1/cos brighter off the axis:
scenes with others are refused.
"""

import argparse
import json
import struct
import time

import numpy as np
import pyluxcore


def main() -> None:
    """Read the command line and render."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("described", help="what `airlight describe SCENE --json` printed")
    parser.add_argument("gltf", help="what `-o` wrote, for the meshes")
    parser.add_argument("output", help="the EXR file")
    parser.add_argument("--samples", type=int, default=4096, help="paths per pixel")
    chosen = parser.parse_args()
    with open(chosen.described, encoding="utf-8") as stream:
        described = json.load(stream)["result"]
    check(described)
    pyluxcore.Init()
    scene = pyluxcore.Scene()
    scene.Parse(properties(media(described) | camera(described) | lights(described["lights"])))
    if described["surfaces"]:
        shapes(scene, described, chosen.gltf)
    width, height = described["camera"]["size"]
    settings = {
        "renderengine.type": "PATHCPU",
        "renderengine.seed": 1,
        "path.pathdepth.total": 1,  # light - one scattering or reflection - eye
        "path.clamping.variance.maxvalue": 0.0,
        "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,  # to either side: a pixel
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB",  # radiance before the image pipeline
        "film.outputs.0.filename": chosen.output,
        "batch.haltspp": chosen.samples,
    }
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(settings), scene))
    session.Start()
    while not session.HasDone():
        time.sleep(0.2)
        session.UpdateStats()
    session.Stop()
    session.GetFilm().SaveOutputs()


def check(described: dict) -> None:
    """Stop before a scene of which LuxCore would be given a part alone."""
    if described["sky"] is not None:
        raise SystemExit("this script makes no sky: choose a scene without one")
    medium = described["medium"]
    if medium is not None and "sigma_s" not in medium:
        raise SystemExit("this script makes homogeneous media alone: choose a scene with one")
    for surface in described["surfaces"]:
        if surface["textured"] or not surface["diffuse"]:
            raise SystemExit(
                f"surface {surface['name']} has a texture or is not diffuse: choose a scene of "
                "diffuse surfaces with one colour each"
            )


def properties(values: dict) -> pyluxcore.Properties:
    """Return settings in LuxCore's type."""
    properties = pyluxcore.Properties()
    for key, value in values.items():
        properties.Set(
            pyluxcore.Property(key, list(value) if isinstance(value, list | tuple) else value)
        )
    return properties


def media(described: dict) -> dict:
    """Return the medium of all space."""
    if described["bounded_media"]:
        raise SystemExit(
            "this script knows a medium of all space alone: choose a scene without bounded media"
        )
    medium = described["medium"]
    if medium is None:
        return {}
    if medium["phase"]["name"] != "isotropic":
        raise SystemExit(
            "LuxCore has Schlick's phase function: choose a scene with an isotropic medium"
        )
    prefix = "scene.volumes.fog."
    return {
        prefix + "type": "homogeneous",
        prefix + "scattering": medium["sigma_s"],
        prefix + "absorption": medium["sigma_a"],
        prefix + "asymmetry": [0.0, 0.0, 0.0],
        "scene.world.volume.default": "fog",
        "scene.camera.volume": "fog",
    }


def camera(described: dict) -> dict:
    """Return a pinhole; the angle of view is that of the longer side.

    LuxCore takes row j for H - 1 - j, not H - j, counted in pixels from the other end: its images
    are a pixel too low. The window of the film, -1 to 1 along the longer side, is moved by that
    pixel.
    """
    camera = described["camera"]
    width, height = camera["size"]
    longer = max(width, height)
    right, top, pixel = width / longer, height / longer, 2 / longer
    position, forward = np.array(camera["position"]), np.array(camera["forward"])
    prefix = "scene.camera."
    return {
        prefix + "type": "perspective",
        prefix + "lookat.orig": camera["position"],
        prefix + "lookat.target": (position + forward).tolist(),
        prefix + "up": camera["up"],
        prefix + "fieldofview": max(camera["fov_horizontal"], camera["fov_vertical"]),
        prefix + "screenwindow": [-right, right, -top - pixel, top - pixel],
        prefix + "cliphither": 1e-6,
        prefix + "clipyon": 1e6,
        prefix + "autofocus.enable": False,
        prefix + "lensradius": 0.0,
    }


def lights(described: list[dict]) -> dict:
    """Return point lights: without `power` and `efficiency`, the colour is the flux 4 pi I [W]."""
    settings: dict = {}
    for number, light in enumerate(described):
        if light["kind"] != "point":
            raise SystemExit(
                f"a {light['kind']} light of LuxCore is another one: choose a scene with point "
                "lights"
            )
        prefix = f"scene.lights.lamp{number}."
        settings |= {
            prefix + "type": "point",
            prefix + "position": light["position"],
            prefix + "color": (4 * np.pi * np.array(light["intensity"])).tolist(),
        }
    return settings


def shapes(scene: pyluxcore.Scene, described: dict, path: str) -> None:
    """Add the meshes of a .glb file, turned back to the scene's axes, with
    a diffuse material each.
    """
    with open(path, "rb") as stream:
        data = stream.read()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    turn = np.array(document["scenes"][0]["extras"]["scene_to_gltf"])
    surfaces = {surface["name"]: surface for surface in described["surfaces"]}
    for mesh in document["meshes"]:
        primitive, name = mesh["primitives"][0], mesh["name"]
        points = accessor(document, binary, primitive["attributes"]["POSITION"], "<f4") @ turn
        triangles = accessor(document, binary, primitive["indices"], "<u4").reshape(-1, 3)
        corners, faces = [tuple(p) for p in points.tolist()], [tuple(t) for t in triangles.tolist()]
        scene.DefineMesh(name, corners, faces, None, None, None, None)
        place = {f"scene.objects.{name}.shape": name, f"scene.objects.{name}.material": name}
        scene.Parse(properties(material(name, surfaces[name]) | place))


def material(name: str, surface: dict) -> dict:
    """Return a diffuse material, black from behind if the surface is so; its sides come first."""
    prefix, front = f"scene.materials.{name}", surface["reflectance"]
    back = front if surface["two_sided"] else [0.0, 0.0, 0.0]
    return {
        f"{prefix}-front.type": "matte",
        f"{prefix}-front.kd": front,
        f"{prefix}-back.type": "matte",
        f"{prefix}-back.kd": back,
        f"{prefix}.type": "twosided",
        f"{prefix}.frontmaterial": f"{name}-front",
        f"{prefix}.backmaterial": f"{name}-back",
    }


def accessor(document: dict, binary: bytes, number: int, kind: str) -> np.ndarray:
    """Return an array of a .glb file."""
    about = document["accessors"][number]
    view = document["bufferViews"][about["bufferView"]]
    count = about["count"] * (3 if about["type"] == "VEC3" else 1)
    values = np.frombuffer(binary, kind, count, view["byteOffset"])
    return values.reshape(about["count"], -1).astype(float if kind == "<f4" else int)


if __name__ == "__main__":
    main()
