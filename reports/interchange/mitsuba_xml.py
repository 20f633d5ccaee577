# SPDX-License-Identifier: BSD-3-Clause
"""A scene as a Mitsuba XML file with its meshes beside it.

All numbers are written as the shortest decimal words of their float32 values, which Mitsuba holds:
the file says the scene exactly, and the last digits of a machine's sines do not change its bytes.
"""

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import quoteattr

import mitsuba as mi
import numpy as np

from airlight.reference.scene.transforms import matrix_of
from airlight.validation.arrays import Array
from airlight.validation.scenes.meshes import Mesh
from airlight.validation.scenes.parts import Plugin

#: The elements of the plugins that such scenes have.
_ELEMENTS = {
    "volpath": "integrator",
    "perspective": "sensor",
    "independent": "sampler",
    "hdrfilm": "film",
    "box": "rfilter",
    "homogeneous": "medium",
    "heterogeneous": "medium",
    "heightfog": "volume",
    "isotropic": "phase",
    "hg": "phase",
    "rayleigh": "phase",
    "point": "emitter",
    "spot": "emitter",
    "directional": "emitter",
    "ply": "shape",
    "sphere": "shape",
    "cube": "shape",
    "rectangle": "shape",
    "twosided": "bsdf",
    "diffuse": "bsdf",
}
#: The elements of lists of three numbers that are no colours, by their names.
_TRIPLES = {"position": "point", "center": "point", "direction": "vector"}


def scene_xml(scene: Plugin, comment: str = "") -> str:
    """Return a Mitsuba XML file for the dictionary of a scene, whose meshes are files.

    Parameters
    ----------
    scene
        As `mi.load_dict` takes it, made of numbers, words, transforms and plugins of `_ELEMENTS`;
        a transform may be {"matrix": rows} too.
    comment
        Words at the top.
    """
    lines = ['<?xml version="1.0" encoding="utf-8"?>', '<scene version="3.0.0">']
    lines += [f"    <!-- {comment} -->"] if comment else []
    for name, part in scene.items():
        if isinstance(part, Mapping):
            lines += ["    " + line for line in _plugin(name, part, label="id")]
    return "\n".join([*lines, "</scene>", ""])


def _lines(name: str, value: object) -> Iterator[str]:
    """Yield the lines of a property or a plugin."""
    named = f"name={quoteattr(name)}"
    if isinstance(value, Mapping) and "matrix" in value:
        yield from _lines(name, np.array(value["matrix"]))
    elif isinstance(value, Mapping):
        yield from _plugin(name, value, label="name")
    elif isinstance(value, mi.ScalarTransform4f | mi.ScalarTransform4d | np.ndarray):
        matrix = value if isinstance(value, np.ndarray) else matrix_of(value)
        yield f'<transform {named}><matrix value="{_words(matrix)}"/></transform>'
    elif isinstance(value, list | tuple):
        x, y, z = (word(each) for each in value)
        yield f'<{_TRIPLES[name]} {named} x="{x}" y="{y}" z="{z}"/>'
    elif isinstance(value, bool):
        yield f'<boolean {named} value="{str(value).lower()}"/>'
    elif isinstance(value, int):
        yield f'<integer {named} value="{value}"/>'
    elif isinstance(value, float):
        yield f'<float {named} value="{word(value)}"/>'
    else:
        yield f"<string {named} value={quoteattr(str(value))}/>"


def _plugin(name: str, plugin: Mapping[str, object], *, label: str) -> Iterator[str]:
    """Yield the lines of a plugin; parts of a scene have an id, parts of these a name."""
    kind = str(plugin["type"])
    if kind == "rgb":
        yield f'<rgb name={quoteattr(name)} value="{_words(plugin["value"])}"/>'
        return
    if kind == "ref":
        yield f"<ref name={quoteattr(name)} id={quoteattr(str(plugin['id']))}/>"
        return
    element = _ELEMENTS[kind]
    yield f"<{element} type={quoteattr(kind)} {label}={quoteattr(name)}>"
    for key, value in plugin.items():
        if key not in ("type", "id"):
            yield from ("    " + line for line in _lines(key, value))
    yield f"</{element}>"


def _words(values: object) -> str:
    return " ".join(word(float(each)) for each in np.asarray(values, dtype=np.float64).ravel())


def word(value: float) -> str:
    """Return the shortest decimal word of a number's float32 value."""
    # + 0.0 removes the sign of a zero.
    return repr(float(np.format_float_scientific(np.float32(value))) + 0.0)


def ply_bytes(mesh: Mesh) -> bytes:
    """Return a mesh as a binary PLY file in float32."""
    vertices, faces = mesh
    head = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    # Each face is a byte, which says three, and three numbers of vertices.
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    rows["count"], rows["corners"] = 3, faces
    corners: Array = np.asarray(vertices, dtype=np.float64)
    return "\n".join(head).encode() + corners.astype("<f4").tobytes() + rows.tobytes()
