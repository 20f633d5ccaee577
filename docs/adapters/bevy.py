#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bevy: a `FogVolume` and lamps, by the module `pybevy`. See README.md.

    airlight capture bevy sphere-spot --size 160x120 -o x.exr --set step_count=1024

`pybevy` wants CPython 3.12 or newer, and lies in an environment of its own, which this program
looks for and starts; AIRLIGHT_BEVY_PYTHON names the Python of another one. No graphics card and no
display are needed: Mesa's lavapipe draws (Debian: mesa-vulkan-drivers).

A lamp adds the sum over steps of

    sigma_s light_intensity I/max(r^2, 0.0001) (1 - (r/range)^4)^2 edge V exp(-sigma_t R) T dt

with T to the end of the step and R the radius of the box of the fog. `light_intensity` is set to
exp(sigma_t R)/(4 pi): the fog is isotropic, and light is not attenuated on its way.
"""

import importlib
import json
import math
import os
import shlex
import struct
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

VERSION = "0.2.1"
WRONG, MISSING = 2, 3  # exit statuses, those of airlight
_PYTHON = "AIRLIGHT_BEVY_PYTHON"
_STARTED = "AIRLIGHT_BEVY_STARTED"  # says to a Python that it was started for its `pybevy`
_DRIVERS = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")

#: Settings of the engine by their names in Rust; 0 stands for a length that the scene gives.
SETTINGS: dict[str, float | int] = {
    "step_count": 512,
    "jitter": 0.0,
    "near": 0.02,  # where fog begins [m]
    "far": 0.0,  # where fog ends [m]
    "range": 0.0,  # where the light of lamps ends [m]
    "shadow_map": 2048,
    "shadow_depth_bias": 0.08,  # less takes light from the fog of spots
    "shadow_normal_bias": 1.8,  # of surfaces alone
    "perceptual_roughness": 0.6,  # Burley's law of it is the nearest to Lambert's
}
_LIBRARIES = "libasound2 libffi8 libwayland-client0"  #: that pybevy loads, as Debian has them
_LAMPS = 8  #: the most whose shadow maps are brought
_SHOWN, _BLACK = 1, 2  #: layers of surfaces as they are, and of black ones that cast no shadows
_LAYERS = {"total": _SHOWN, "airlight": _BLACK}
#: Layers of the pictures that are read by bytes, one for each channel.
_READ = 3

#: Gives the bits of a float as a colour of 8 bits, which alone the module reads.
_SHADER = """\
#import bevy_pbr::forward_io::VertexOutput
struct Bits { channel: f32 }
@group(3) @binding(100) var<uniform> material: Bits;
@group(3) @binding(101) var picture: texture_2d<f32>;
@group(3) @binding(102) var picture_sampler: sampler;
fn decoded(bits: u32) -> f32 {
    let code = f32(bits & 255u) / 255.0;
    return select(pow((code + 0.055) / 1.055, 2.4), code / 12.92, code <= 0.04045);
}
@fragment
fn fragment(in: VertexOutput) -> @location(0) vec4<f32> {
    let value = textureLoad(picture, vec2<i32>(in.position.xy), 0)[u32(material.channel)];
    let bits = bitcast<u32>(value);
    return vec4(decoded(bits), decoded(bits >> 8u), decoded(bits >> 16u), f32(bits >> 24u) / 255.0);
}
"""


@dataclass(frozen=True)
class Scene:
    """A scene as arrays, with y up."""

    described: dict[str, Any]
    camera: Any  #: 4 by 4, its rows are the axes and the place
    lights: list[tuple[dict[str, Any], Any]]  #: descriptions, with matrices as that of the camera
    meshes: list[tuple[Any, Any, dict[str, Any]]]  #: corners and normals of triangles, description

    @property
    def medium(self) -> dict[str, Any]:
        """The fog."""
        medium: dict[str, Any] = self.described["medium"]
        return medium

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image."""
        width, height = self.described["camera"]["size"]
        return width, height


def end(status: int, words: str) -> NoReturn:
    """End with a line on the error stream."""
    print(" ".join(words.split()), file=sys.stderr, flush=True)
    os._exit(status)


def main() -> None:
    """Be the adapter."""
    began = time.perf_counter()
    if len(sys.argv) < 4:
        end(WRONG, f"expected {Path(sys.argv[0]).name} SCENE.json SCENE.glb OUT.exr NAME=VALUE...")
    described_path, gltf, output, *words = sys.argv[1:]
    settings = SETTINGS | dict(setting(word) for word in words)
    # A scene that the engine cannot have is refused before anything is looked for.
    described = json.loads(Path(described_path).read_text(encoding="utf-8"))["result"]
    refused = refusal(described)
    if refused:
        end(WRONG, f"Bevy: {refused}")
    find_pybevy()
    find_driver()
    # Bevy prints on the output, which belongs to one line of JSON: that goes to the error stream.
    told = os.dup(1)
    os.dup2(2, 1)
    try:
        scene = read_scene(described, gltf)
        settings = lengths(scene, settings)
        output = os.path.abspath(output)
        write_exr(output, draw(scene, settings), scene.size)
    except Exception:
        traceback.print_exc()
        os._exit(1)
    data = {
        "engine": "Bevy",
        "version": f"0.18 of pybevy {VERSION}",
        "settings": settings,
        "seconds": round(time.perf_counter() - began, 3),
        "problems": [],
        "pixel": "centre",
        "device": "Vulkan, llvmpipe of Mesa",
    }
    if settings["jitter"] == 0:
        data["model"] = model(settings)
    os.write(told, (json.dumps(data) + "\n").encode())
    os._exit(0)


def setting(word: str) -> tuple[str, float | int]:
    """Return a setting by its name, with the type that it has."""
    name, _, value = word.partition("=")
    if name == "edit":
        end(WRONG, "Bevy: its shaders cannot be edited")
    if name not in SETTINGS:
        end(WRONG, f"Bevy has no setting '{name}' here; it has {', '.join(SETTINGS)}")
    kind = type(SETTINGS[name])
    try:
        number = kind(value)
    except ValueError:
        number = kind(-1)
    if not (math.isfinite(number) and number >= 0):
        whole = "a whole number" if kind is int else "a number"
        end(WRONG, f"{name}: got '{value}', expected {whole} from 0 on")
    return name, number


def refusal(described: dict[str, Any]) -> str | None:
    """Return why the adapter cannot bring a scene; None where it can."""
    lights, medium = described["lights"], described["medium"]
    if described["bounded_media"]:
        return "the adapter brings fog without bounds alone"
    if not medium:
        return "the scene has no fog"
    if "sigma_t" not in medium:
        return "the adapter brings homogeneous fog alone"
    if len(set(medium["sigma_t"])) > 1:
        return "its fog has one extinction for all colours; expected a grey one"
    if medium["sigma_t"][0] == 0:
        return "the scene has no fog"
    if any(light["kind"] not in ("point", "spot") for light in lights):
        return "the adapter brings no lights but lamps"
    if described["sky"]:
        return "the adapter brings no sky"
    if not 0 < len(lights) <= _LAMPS:
        return f"the adapter brings 1 to {_LAMPS} lamps, with shadows; got {len(lights)}"
    for surface in described["surfaces"]:
        if surface["textured"] or not surface["diffuse"]:
            how = "textured" if surface["textured"] else "not diffuse"
            name = surface["name"]
            return f"the adapter brings diffuse surfaces of one colour, and '{name}' is {how}"
    return None


def model(settings: dict[str, Any]) -> str:
    """Return the equation as terms of `airlight compare --model`."""
    lamps = f"law=clamped:0.01,range=quartic:{settings['range']:g},spot=cosine-squared"
    fog = f"phase=isotropic,depth=axis-ends,ends=planes:{settings['near']:g}:{settings['far']:g}"
    return f"light-path=off,{lamps},{fog},surface.light-path=off"


def find_pybevy() -> None:
    """Start again with the Python that has `pybevy`, where this one has not."""
    try:
        importlib.import_module("pybevy")
    except ImportError as error:
        why = error
    else:
        return
    cache = os.environ.get("AIRLIGHT_CACHE_DIR") or os.path.expanduser("~/.cache/airlight")
    folder = Path(cache) / f"adapters-pybevy-{VERSION}"
    named = os.environ.get(_PYTHON)
    python = named or str(folder / "bin" / "python")
    if Path(python).exists() and _STARTED not in os.environ:
        os.environ[_STARTED] = "1"
        os.execv(python, [python, *sys.argv])
    if not isinstance(why, ModuleNotFoundError):
        end(MISSING, f"Bevy: pybevy does not load: {why}: `apt-get install -y {_LIBRARIES}`")
    install = f"{shlex.quote(python)} -m pip install pybevy=={VERSION}"
    line = install if named else f"python3.12 -m venv {shlex.quote(str(folder))} && {install}"
    end(MISSING, f"Bevy: the module pybevy is missing, which wants CPython 3.12 or newer: `{line}`")


def find_driver() -> None:
    """Choose Mesa's lavapipe, which draws on the processor, where the user names no driver."""
    if any(name in os.environ for name in _DRIVERS):
        return
    places = [Path("/usr/share/vulkan/icd.d"), Path("/usr/local/share/vulkan/icd.d")]
    found = sorted(str(file) for place in places for file in place.glob("lvp_icd*.json"))
    if not found:
        end(MISSING, "Bevy: Vulkan is missing: `apt-get install -y mesa-vulkan-drivers` on Debian")
    os.environ.update({name: found[0] for name in _DRIVERS})


def read_scene(described: dict[str, Any], path: str) -> Scene:
    """Read a glTF file, whose y is up, for a description."""
    import numpy as np

    data = Path(path).read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    gltf, blob = json.loads(data[20 : 20 + length]), data[28 + length :]

    def accessor(number: int) -> Any:
        about = gltf["accessors"][number]
        view = gltf["bufferViews"][about["bufferView"]]
        kind = {5126: np.float32, 5125: np.uint32, 5123: np.uint16}[about["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3}[about["type"]]
        first = view.get("byteOffset", 0) + about.get("byteOffset", 0)
        return np.frombuffer(blob, kind, width * about["count"], first).reshape(-1, width)

    def matrices(wanted: Any) -> list[Any]:
        return [np.reshape(node["matrix"], (4, 4)) for node in gltf["nodes"] if wanted(node)]

    (camera,) = matrices(lambda node: "camera" in node)
    placed = matrices(lambda node: "KHR_lights_punctual" in node.get("extensions", {}))
    surfaces = {surface["name"]: surface for surface in described["surfaces"]}
    meshes = []
    for node in gltf["nodes"]:
        if "mesh" not in node or node["name"] not in surfaces:
            continue
        for part in gltf["meshes"][node["mesh"]]["primitives"]:
            order = accessor(part["indices"]).ravel()
            corners = accessor(part["attributes"]["POSITION"])[order].reshape(-1, 3, 3)
            if "NORMAL" in part["attributes"]:
                normals = accessor(part["attributes"]["NORMAL"])[order].reshape(-1, 3, 3)
            else:
                a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
                planes = np.cross(b - a, c - a)
                planes /= np.maximum(np.linalg.norm(planes, axis=1, keepdims=True), 1e-30)
                normals = np.repeat(planes[:, None], 3, axis=1)
            meshes.append((corners, normals, surfaces[node["name"]]))
    return Scene(described, camera, list(zip(described["lights"], placed, strict=True)), meshes)


def lengths(scene: Scene, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings with the lengths that the scene gives: fog ends behind the last mesh and four
    times the farthest lamp, or where exp(-8) is left; light has no end before that.
    """
    import numpy as np

    def distance(points: Any) -> float:
        return float(np.linalg.norm(points.reshape(-1, 3) - scene.camera[3, :3], axis=1).max())

    reach = [1.01 * distance(corners) for corners, _, _ in scene.meshes]
    reach += [4.04 * distance(matrix[3, :3]) for _, matrix in scene.lights]
    far = settings["far"] or min(max(reach), 8 / scene.medium["sigma_t"][0])
    far = float(f"{far:.6g}")
    return settings | {"far": far, "range": settings["range"] or float(f"{4 * far:.6g}")}


def draw(scene: Scene, settings: dict[str, Any]) -> dict[str, Any]:
    """Return the planes of the layers, (height, width) each, by the names of their channels."""
    import numpy as np

    folder = Path(os.environ.get("TMPDIR", "/tmp"))
    (folder / "assets").mkdir(exist_ok=True)
    (folder / "assets" / "bits.wgsl").write_text(_SHADER, encoding="utf-8")
    os.chdir(folder)  # whose `assets` are looked up
    os.environ["WGPU_BACKEND"] = "vulkan"
    bevy = _Bevy()
    read = bevy.module("_internal.render_readback")
    app, cameras = bevy.App(), list[tuple[Any, Any]]()
    window = bevy.WindowPlugin(primary_window=None, exit_condition=bevy.ExitCondition.DontExit)
    plugins = bevy.DefaultPlugins().set(window).disable(bevy.WinitPlugin)
    # Frames would lack what is not compiled yet.
    plugins = plugins.set(bevy.RenderPlugin(synchronous_pipeline_compilation=True))
    for plugin in (plugins, bevy.ShaderMaterialPlugin(), read.ImageCopyPlugin()):
        app.add_plugins(plugin)
    shadows = settings["shadow_map"]
    for resource in (
        bevy.PointLightShadowMap(size=shadows),
        bevy.DirectionalLightShadowMap(size=shadows),  # that of spots too
        bevy.GlobalAmbientLight(brightness=0.0),
        bevy.ClearColor(bevy.Color.linear_rgb(0.0, 0.0, 0.0)),
    ):
        app.insert_resource(resource)
    kind = type("Bits", (), {"channel": 0.0, "picture": None})
    kind.__annotations__ = {"channel": float, "picture": bevy.Image}
    bits = bevy.material(fragment_shader="bits.wgsl")(kind)

    def set_up(commands: Any, meshes: Any, materials: Any, images: Any, packed: Any) -> None:
        spawn_surfaces(bevy, scene, settings, commands, meshes, materials)
        spawn_lights(bevy, scene, settings, commands)
        pictures = spawn_views(bevy, scene, settings, commands, images)
        square = meshes.add(bevy.Rectangle(10.0, 10.0))
        for number, (picture, channel) in enumerate(
            (picture, channel) for picture in pictures for channel in range(3)
        ):
            only = bevy.RenderLayers.layer(_READ + number)
            cover = packed.add(bits(channel=float(channel), picture=picture))
            commands.spawn(
                bevy.Mesh3d(square),
                bevy.MeshMaterial3d[bits](cover),
                bevy.Transform.IDENTITY,
                bevy.NotShadowCaster(),
                only,
            )
            target = images.add(bevy.Image.new_render_target(*scene.size))
            seen = commands.spawn(
                bevy.Camera3d(),
                bevy.Camera(order=_READ + number),
                bevy.RenderTarget.image(target),
                bevy.Msaa.Off,
                bevy.Tonemapping.NONE,
                bevy.Transform.from_xyz(0.0, 0.0, 1.0).looking_at(bevy.Vec3.ZERO, bevy.Vec3.Y),
                only,
            )
            cameras.append((seen.id().to_bits(), target))

    assets = [bevy.Mesh, bevy.StandardMaterial, bevy.Image, bits]
    of_assets = [bevy.ResMut[bevy.Assets[each]] for each in assets]
    names = ("commands", "meshes", "materials", "images", "packed", "return")
    set_up.__annotations__ = dict(zip(names, [bevy.Commands, *of_assets, None], strict=True))
    app.add_systems(bevy.Startup, set_up)

    # A picture is read some frames after it is drawn.
    app.initialize()
    app.update()
    app.update()
    for camera, target in cameras:
        read.spawn_image_copier(app, camera, target, *scene.size)
    frames = dict[int, bytes]()
    for number in range(100):
        app.update()
        for place, (camera, _) in enumerate(cameras):
            frame = read.try_receive_frame(app, camera)
            if frame is not None:
                frames[place] = frame
        if len(frames) == len(cameras) and number >= 5:
            break
    else:
        raise RuntimeError("no picture came within 100 frames")

    width, height = scene.size
    planes = []
    for place in range(len(cameras)):
        # Rows may be longer than the picture.
        rows = np.frombuffer(frames[place], np.uint8).reshape(height, -1)[:, : 4 * width]
        planes.append(np.ascontiguousarray(rows).view("<f4").reshape(height, width))
        if not (np.abs(planes[-1]) < 1e5).all():  # the engine has half floats
            raise RuntimeError("the picture that was read has no bits of floats")
    made = {f"{layer}.{c}": planes.pop(0) for layer in _LAYERS for c in "RGB"}
    for c in "RGB":
        made[f"surface.{c}"] = made.pop(f"total.{c}") - made[f"airlight.{c}"]
    return made


class _Bevy:
    """The modules of `pybevy`, by its own names."""

    _NAMES = "prelude light camera wgpu render image mesh pbr window winit decorators"

    def __init__(self) -> None:
        self._modules = [self.module(name) for name in self._NAMES.split()]

    def module(self, name: str) -> Any:
        return importlib.import_module(f"pybevy.{name}")

    def __getattr__(self, name: str) -> Any:
        for module in self._modules:
            if hasattr(module, name):
                return getattr(module, name)
        raise AttributeError(f"pybevy has no {name}")

    def vector(self, values: Any) -> Any:
        return self.Vec3(*map(float, values))

    def color(self, values: Any) -> Any:
        return self.Color.linear_rgb(*map(float, values))


def spawn_surfaces(
    bevy: Any, scene: Scene, settings: dict[str, Any], commands: Any, meshes: Any, materials: Any
) -> None:
    """Spawn every surface twice, as it is and black; one that has one side gets a black back."""
    import numpy as np

    for corners, normals, surface in scene.meshes:
        parts = [(corners, normals, surface["reflectance"])]
        if not surface["two_sided"]:
            parts.append((corners[:, ::-1], -normals[:, ::-1], [0, 0, 0]))
        for places, directions, reflectance in parts:
            mesh = bevy.Mesh(bevy.PrimitiveTopology.TriangleList)
            flat = np.ascontiguousarray(places.reshape(-1, 3), np.float32)
            mesh.insert_attribute(bevy.Mesh.ATTRIBUTE_POSITION, flat)
            flat = np.ascontiguousarray(directions.reshape(-1, 3), np.float32)
            mesh.insert_attribute(bevy.Mesh.ATTRIBUTE_NORMAL, flat)
            mesh.insert_indices(np.arange(len(flat), dtype=np.uint32))
            handle = meshes.add(mesh)
            sides = {"double_sided": True, "cull_mode": None} if surface["two_sided"] else {}
            for layer, color in ((_SHOWN, reflectance), (_BLACK, [0, 0, 0])):
                cover = bevy.StandardMaterial(
                    base_color=bevy.color(color),
                    reflectance=0.0,
                    metallic=0.0,
                    perceptual_roughness=settings["perceptual_roughness"],
                    **sides,
                )
                commands.spawn(
                    bevy.Mesh3d(handle),
                    bevy.MeshMaterial3d(materials.add(cover)),
                    bevy.Transform.IDENTITY,
                    bevy.RenderLayers.layer(layer),
                    *([bevy.NotShadowCaster()] if layer == _BLACK else []),
                )


def spawn_lights(bevy: Any, scene: Scene, settings: dict[str, Any], commands: Any) -> None:
    """Spawn the lamps, and the fog: a box about the camera."""
    for light, matrix in scene.lights:
        brightest = max(light["intensity"]) or 1.0  # of a lamp that is off
        values = {
            "color": bevy.color([each / brightest for each in light["intensity"]]),
            # In lumens, also that of spots.
            "intensity": 4 * math.pi * max(light["intensity"]),
            "range": settings["range"],
            "shadows_enabled": True,
            "shadow_depth_bias": settings["shadow_depth_bias"],
            "shadow_normal_bias": settings["shadow_normal_bias"],
        }
        at = bevy.Transform.from_translation(bevy.vector(matrix[3, :3]))
        if light["kind"] == "spot":
            values["outer_angle"] = math.radians(light["cutoff_angle"])
            # The edge needs a width.
            values["inner_angle"] = math.radians(
                min(light["beam_angle"], light["cutoff_angle"] - 0.01)
            )
            upright = abs(matrix[2, 1]) > 0.99
            up = bevy.Vec3.X if upright else bevy.Vec3.Y
            at = at.looking_to(bevy.vector(-matrix[2, :3]), up)
        kind = bevy.SpotLight if light["kind"] == "spot" else bevy.PointLight
        both = bevy.RenderLayers.from_layers([_SHOWN, _BLACK])
        commands.spawn(kind(**values), bevy.VolumetricLight(), at, both)

    extinction = scene.medium["sigma_t"][0]
    radius = math.sqrt(3) * settings["far"]
    fog = bevy.FogVolume(
        density_factor=1.0,
        absorption=0.0,  # both count in extinction alone: the colour says what is scattered
        scattering=extinction,
        fog_color=bevy.color([each / extinction for each in scene.medium["sigma_s"]]),
        light_intensity=math.exp(extinction * radius) / (4 * math.pi),
    )
    place = pose(bevy, scene).with_scale(bevy.vector([2 * settings["far"]] * 3))
    commands.spawn(fog, place)


def pose(bevy: Any, scene: Scene) -> Any:
    """Return where the camera is, and where it looks."""
    right, up, back, place = (bevy.vector(row[:3]) for row in scene.camera)
    del right
    return bevy.Transform.from_translation(place).looking_to(back * -1.0, up)


def spawn_views(
    bevy: Any, scene: Scene, settings: dict[str, Any], commands: Any, images: Any
) -> Sequence[Any]:
    """Spawn a camera for each layer, and return the pictures that they draw."""
    pictures = []
    width, height = scene.size
    for order, layer in enumerate(_LAYERS.values()):
        picture = bevy.Image.new_target_texture(width, height, bevy.TextureFormat.Rgba32Float)
        pictures.append(images.add(picture))
        lens = bevy.PerspectiveProjection(
            fov=math.radians(scene.described["camera"]["fov_vertical"]),
            aspect_ratio=width / height,
            near=settings["near"],
            far=4 * settings["far"],
        )
        lens.near_clip_plane = bevy.Vec4(0.0, 0.0, -1.0, -settings["near"])
        commands.spawn(
            bevy.Camera3d(),
            bevy.Camera(order=order),
            bevy.RenderTarget.image(pictures[-1]),
            bevy.Hdr(),
            bevy.Msaa.Off,
            bevy.Tonemapping.NONE,
            bevy.Exposure(ev100=-math.log2(1.2)),  # a factor of 1
            bevy.Projection.Perspective(lens),
            bevy.VolumetricFog(
                ambient_intensity=0.0,
                step_count=settings["step_count"],
                jitter=settings["jitter"],
            ),
            pose(bevy, scene),
            bevy.RenderLayers.layer(layer),
        )
    return pictures


def write_exr(path: str, planes: dict[str, Any], size: tuple[int, int]) -> None:
    """Write an OpenEXR file: one part, scan lines, 32-bit floats, as they are."""
    width, height = size
    names = sorted(planes)

    def text(words: str) -> bytes:
        return words.encode("ascii") + b"\0"

    def attribute(name: str, kind: str, data: bytes) -> bytes:
        return text(name) + text(kind) + struct.pack("<i", len(data)) + data

    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(text(name) + struct.pack("<4i", 2, 0, 1, 1) for name in names) + b"\0"
    head = struct.pack("<2i", 20000630, 2) + b"".join(
        [
            attribute("channels", "chlist", channels),
            attribute("compression", "compression", b"\0"),
            attribute("dataWindow", "box2i", window),
            attribute("displayWindow", "box2i", window),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
            b"\0",
        ]
    )
    length = 4 * width * len(names)
    first = len(head) + 8 * height
    table = struct.pack(f"<{height}Q", *(first + row * (8 + length) for row in range(height)))
    with open(path, "wb") as file:
        file.write(head + table)
        for row in range(height):
            file.write(struct.pack("<2i", row, length))
            for name in names:
                file.write(planes[name][row].astype("<f4").tobytes())


if __name__ == "__main__":
    main()
