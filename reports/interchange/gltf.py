# SPDX-License-Identifier: BSD-3-Clause
"""A scene as binary glTF 2.0, with the same camera and lights, for engines and modelling programs.

glTF has y up and cameras that look along -z with x to the right; lengths are metres, as here. The
scene is turned by a quarter about an axis, which is exact, so that its own up axis becomes y: with
z up, (x, y, z) becomes (x, z, -y).

Lights are those of KHR_lights_punctual. Its unit is the candela, 1 lm/sr, and its colours are RGB
factors: here the largest channel of the intensity in W/sr stands as the intensity, the channels
over it as the colour, with no factor of 683 lm/W. Its spots fall off otherwise than Mitsuba's and
their inner angle must be smaller than the outer one. The `extras` of each light, camera, material
and medium hold the exact values of the scene.

The file is written here, not by trimesh, which writes the ratio of the angles of view as the aspect
ratio of a camera, 3 % off at 52 degrees, and no lights.

glTF has no area light, and KHR_lights_punctual none either. Such a light is written as its shape, a
mesh whose material emits (KHR_materials_emissive_strength, whose unit is cd/m^2: here the largest
channel of the radiance in W/(m^2 sr), again with no factor of 683 lm/W). Engines that do not treat
emitting meshes as lights show it and are not lit by it; the `extras` say so, and have the shape in
numbers.

References
----------
Khronos 2021, *glTF 2.0 specification*, sections 3 and 4; KHR_lights_punctual;
KHR_materials_specular; KHR_materials_emissive_strength.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.reference.storage.build import build
from airlight.reference.storage.files import write_bytes
from airlight.reports.interchange.meshes import ShapeMesh, shape_mesh
from airlight.reports.interchange.scene import describe_scene, scene_as_it_is, surface
from airlight.validation.scenes.loading import LoadedScene

Array = NDArray[np.float64]


# Rows: where the axes of glTF's world lie in the scene's, by the axis that points up in the scene.
_TURNS: dict[str, list[list[int]]] = {
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
}


def write_gltf(path: Path, loaded: LoadedScene) -> dict[str, Any]:
    """Write a scene as a .glb file, whole or not at all; the camera's aspect
    ratio is that of the image.

    Returns `path`, `triangles`, `bytes` and `tessellated`, the names of the shapes that are
    not triangles by nature.
    """
    # The description refuses scenes that no renderer here could render, before a file exists.
    described = describe_scene(loaded)
    scene = scene_as_it_is(loaded)
    turn = np.array(_TURNS[described["up"]], dtype=np.float64)
    # Surfaces, bounds of media, lights: the order in which `_document` lists their materials.
    opaque = [shape for shape in scene.occluders.shapes() if not shape.is_emitter()]
    names = {medium.name for medium in scene.media}
    bounds = [shape for shape in loaded.scene.shapes() if shape.id() in names]
    lights = [light.shape for light in scene.area]
    meshes = [shape_mesh(shape) for shape in (*opaque, *bounds, *lights)]
    # A light that reflects is described as a surface too, and is one mesh: that of the light.
    described |= {"surfaces": [surface(shape) for shape in opaque]}
    colours = [
        surface(light.shape)["reflectance"] if light.opaque else [0.0, 0.0, 0.0]
        for light in scene.area
    ]
    data = _container(*_document(described, turn, meshes, colours))
    write_bytes(path, data)
    return {
        "path": str(path),
        "triangles": sum(len(mesh.faces) for mesh in meshes),
        "bytes": len(data),
        "tessellated": [mesh.name for mesh in meshes if not mesh.exact],
    }


def _document(
    described: dict[str, Any], turn: Array, shapes: list[ShapeMesh], colours: list[list[float]]
) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary part; the shapes are surfaces, bounds of
    media, lights, as described; `colours` are the reflectances of these lights.
    """
    buffer = _Buffer()
    # A light of KHR_lights_punctual has a node; an area light is a mesh that emits (see the
    # module).
    punctual = [light for light in described["lights"] if light["kind"] != "area"]
    extended = [light for light in described["lights"] if light["kind"] == "area"]
    materials = [_material(surface) for surface in described["surfaces"]]
    materials += [_boundary(medium) for medium in described["bounded_media"]]
    materials += [_emission(*each) for each in zip(extended, colours, strict=True)]
    # glTF has no empty lists: a mesh without triangles is left out.
    meshes = [
        buffer.mesh(mesh, turn, number) for number, mesh in enumerate(shapes) if len(mesh.faces)
    ]
    nodes: list[dict[str, Any]] = [
        {"name": mesh["name"], "mesh": number} for number, mesh in enumerate(meshes)
    ]
    # Nodes place meshes at the origin, as their vertices are turned already; camera and lights have
    # transforms.
    camera = described["camera"]
    nodes.append({"name": "camera", "camera": 0, "matrix": _camera_matrix(camera, turn)})
    nodes += [
        {
            "name": f"light-{number}",
            "matrix": _light_matrix(light, turn),
            "extensions": {"KHR_lights_punctual": {"light": number}},
        }
        for number, light in enumerate(punctual)
    ]
    # A file has to declare its extensions, and only the ones that it uses.
    used = {
        "KHR_lights_punctual": punctual,
        "KHR_materials_specular": materials,
        "KHR_materials_emissive_strength": extended,
    }
    document = {
        "asset": {"version": "2.0", "generator": f"airlight {build().words}"},
        "extensionsUsed": [name for name, users in used.items() if users],
        "scene": 0,
        "scenes": [
            {
                "name": described["scene"],
                "nodes": list(range(len(nodes))),
                "extras": _scene_extras(described, turn),
            }
        ],
        "nodes": nodes,
        "cameras": [_camera(camera, _near(described, shapes))],
    }
    if punctual:
        document["extensions"] = {
            "KHR_lights_punctual": {"lights": [_light(light) for light in punctual]}
        }
    if meshes:
        document |= {
            "meshes": meshes,
            "materials": materials,
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{"byteLength": len(buffer.data)}],
        }
    return document, bytes(buffer.data)


def _scene_extras(described: dict[str, Any], turn: Array) -> dict[str, Any]:
    return {
        "medium": described["medium"],
        "sky": described["sky"],
        "radiance": described["radiance"],
        "scene_to_gltf": turn.astype(int).tolist(),
        "units": "m, 1/m, W/sr, W/(m^2 sr)",
    }


def _near(described: dict[str, Any], shapes: list[ShapeMesh]) -> float:
    """Return the distance of the near plane, which glTF requires [m]: a millimetre, or a
    thousandth of the way to the farthest place of a scene that is smaller than a metre.
    """
    eye = np.array(described["camera"]["position"])
    places = [light["position"] for light in described["lights"] if "position" in light]
    points = np.concatenate([np.reshape(places, (-1, 3)), *(mesh.vertices for mesh in shapes)])
    farthest = float(np.linalg.norm(points - eye, axis=1).max(initial=0.0))
    return 1e-3 * min(1.0, farthest or 1.0)


def _camera(camera: dict[str, Any], near: float) -> dict[str, Any]:
    # glTF takes the vertical angle of view, Mitsuba gives the horizontal one.
    width, height = camera["size"]
    tangent = np.tan(0.5 * np.deg2rad(camera["fov_horizontal"]))
    return {
        "name": "camera",
        "type": "perspective",
        "perspective": {
            "yfov": float(2 * np.arctan(tangent * height / width)),
            "aspectRatio": width / height,
            # The medium begins at the pinhole all the same.
            "znear": near,
        },
        "extras": {"size": camera["size"], "fov_horizontal_degrees": camera["fov_horizontal"]},
    }


def _camera_matrix(camera: dict[str, Any], turn: Array) -> list[float]:
    backward = -np.array(camera["forward"])
    return _matrix(np.array([camera["right"], camera["up"], backward]).T, camera["position"], turn)


_KEYS = {"W/sr": "w_per_sr", "W/m^2": "w_per_m2"}


def _light(light: dict[str, Any]) -> dict[str, Any]:
    # For a directional light the format requires lux in place of candela.
    quantity, unit = (
        ("irradiance", "W/m^2") if light["kind"] == "directional" else ("intensity", "W/sr")
    )
    # Intensity and colour: the largest channel, and the channels over it.
    intensity = np.array(light[quantity])
    largest = float(intensity.max())
    punctual: dict[str, Any] = {
        "type": light["kind"],
        "intensity": largest,
        "color": (intensity / largest if largest > 0 else np.ones(3)).tolist(),
        "extras": {
            f"{quantity}_{_KEYS[unit]}": light[quantity],
            "unit": f"the intensity of this light is in {unit}: no factor of 683 lm/W is in it",
            "falloff": light["falloff"],
        },
    }
    if light["kind"] == "spot":
        outer = float(np.deg2rad(light["cutoff_angle"]))
        # The format requires an inner angle below the outer one, also for a cone with a hard edge.
        inner = min(float(np.deg2rad(light["beam_angle"])), outer * (1 - 1e-4))
        punctual["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
        punctual["extras"] |= {key: light[key] for key in ("beam_angle", "cutoff_angle")}
    return punctual


def _light_matrix(light: dict[str, Any], turn: Array) -> list[float]:
    """Return the transform of a light, which shines along its own -z."""
    position = light.get("position", [0.0, 0.0, 0.0])  # a directional light has no position
    if "axis" not in light:
        return _matrix(np.eye(3), position, turn)
    # Any two axes across the light's own do, as its light is symmetric about it; the coordinate
    # axis least along it gives the best-conditioned cross product.
    backward = -np.array(light["axis"])
    side = np.cross(np.eye(3)[np.argmin(np.abs(backward))], backward)
    side /= np.linalg.norm(side)
    return _matrix(np.array([side, np.cross(backward, side), backward]).T, position, turn)


def _matrix(axes: Array, position: list[float], turn: Array) -> list[float]:
    """Return a transform as glTF lists it, column by column; `axes` has
    the node's axes as columns.
    """
    matrix = np.eye(4)
    # The axes are in float32, but the format requires a rotation.
    # Without its singular values the matrix is the nearest rotation. Adding 0.0 removes the sign of
    # zeros.
    unit, _, other = np.linalg.svd(turn @ axes)
    matrix[:3, :3] = unit @ other
    matrix[:3, 3] = turn @ np.array(position)
    return [float(value) + 0.0 for value in matrix.T.reshape(-1)]


def _material(surface: dict[str, Any]) -> dict[str, Any]:
    """Return a material that reflects diffusely and nothing else."""
    extras = {key: surface[key] for key in ("reflectance", "textured", "diffuse")}
    matte = _matte(surface["name"], _opaque(surface["reflectance"]), extras)
    return matte | {"doubleSided": surface["two_sided"]}


def _opaque(reflectance: list[float]) -> list[float]:
    return [*(min(1.0, value) for value in reflectance), 1.0]


def _emission(light: dict[str, Any], reflectance: list[float]) -> dict[str, Any]:
    """Return the material of an area light: black where it reflects nothing, and as
    bright as the light on the side of its normal.
    """
    # Its emission is strength times factor.
    largest = max(light["radiance"])
    extras = {
        "light": light,
        "note": "core glTF has no area light: this mesh emits; to some engines no mesh is a light",
        "unit": "emissiveStrength is in W/(m^2 sr): no factor of 683 lm/W is in it",
    }
    made = _matte(f"light {light['name']}", _opaque(reflectance), extras)
    made["emissiveFactor"] = [
        value / largest if largest > 0 else 0.0 for value in light["radiance"]
    ]
    made["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": largest}
    return made


def _boundary(medium: dict[str, Any]) -> dict[str, Any]:
    """Return a material for the bounds of a medium: nothing is seen of them, what is in
    them stands in the extras.
    """
    return _matte(f"medium {medium['name']}", [1.0, 1.0, 1.0, 0.0], {"medium": medium}) | {
        "alphaMode": "BLEND"
    }


def _matte(name: str, colour: list[float], extras: dict[str, Any]) -> dict[str, Any]:
    """Return a material without a gloss, of one side."""
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": colour,
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
        "extras": extras,
    }


class _Buffer:
    """The binary part, with the list of what lies where."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def mesh(self, mesh: ShapeMesh, turn: Array, material: int) -> dict[str, Any]:
        """Add a mesh and return its entry."""
        # The numbers of glTF for the types of values, and for what a view holds.
        float_type, unsigned_type = 5126, 5125
        for_vertices, for_indices = 34962, 34963
        vertices = (mesh.vertices @ turn.T).astype("<f4")
        attributes = {"POSITION": self._add(vertices, "VEC3", float_type, for_vertices)}
        # The format requires the bounds of positions, of the float32 values that are in the file.
        self.accessors[-1] |= {
            "min": vertices.min(axis=0).tolist(),
            "max": vertices.max(axis=0).tolist(),
        }
        if mesh.normals is not None:
            normals = (mesh.normals @ turn.T).astype("<f4")
            attributes["NORMAL"] = self._add(normals, "VEC3", float_type, for_vertices)
        indices = self._add(
            mesh.faces.astype("<u4").reshape(-1), "SCALAR", unsigned_type, for_indices
        )
        return {
            "name": mesh.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": material}],
        }

    def _add(self, values: NDArray[Any], kind: str, component: int, target: int) -> int:
        """Add an array, every number of which has four bytes, and return
        the number of its accessor.
        """
        data = values.tobytes()
        # A view says where the bytes lie, an accessor what numbers they are.
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), "target": target}
        )
        self.data += data
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(values),
                "type": kind,
            }
        )
        return len(self.accessors) - 1


def _container(document: dict[str, Any], binary: bytes) -> bytes:
    """Return the bytes of a .glb file: a header, the JSON, the binary part,
    each padded to four bytes.
    """
    # JSON is padded with spaces and the binary part with zeros, as the format demands. Each chunk
    # begins with its length and its kind; the header has 12 bytes.
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=True, allow_nan=False).encode()
    chunks = [(b"JSON", text + b" " * (-len(text) % 4))]
    chunks += [(b"BIN\0", binary + b"\0" * (-len(binary) % 4))] if binary else []
    body = b"".join(struct.pack("<I", len(data)) + kind + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
