# SPDX-License-Identifier: BSD-3-Clause
"""A certified scene as Mitsuba XML, from the dictionary that the certified file has of it."""

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

#: The tag of a plugin by its key in the dictionary, of numbered ones without their number.
_TAGS = {
    "fog": "medium",
    "phase": "phase",
    "sensor": "sensor",
    "film": "film",
    "rfilter": "rfilter",
    "light": "emitter",
    "occluder": "shape",
    "bsdf": "bsdf",
}
#: Vectors of numbers that Mitsuba calls points.
_POINTS = ("position", "center")
#: A single scattering, by paths of light - fog - eye; Russian roulette would only add noise.
_INTEGRATOR = {"max_depth": 2, "rr_depth": 1000}
_SAMPLES = 4096  # of a pixel: noise of about a per cent, in seconds


def mitsuba_xml(scene: Mapping[str, Any], head: str) -> str:
    """Return a scene of the certified file as XML of Mitsuba 3; `head` is a comment."""
    root = ElementTree.Element("scene", version="3.0.0")
    root.append(ElementTree.Comment(f" {head} "))
    integrator = ElementTree.SubElement(root, "integrator", type="volpath")
    for name, value in _INTEGRATOR.items():
        _add(integrator, name, value)
    for name, value in scene["mitsuba"].items():
        if name != "type":
            _add(root, name, value)
    # The film has no samples: they belong to a sampler, which the dictionary leaves to the user.
    sensor = root.find("sensor")
    assert sensor is not None
    _add(ElementTree.SubElement(sensor, "sampler", type="independent"), "sample_count", _SAMPLES)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(parent: ElementTree.Element, name: str, value: Any) -> None:
    """Add a property or a plugin to an element."""
    if isinstance(value, dict) and "matrix" in value:
        numbers = " ".join(repr(number) for row in value["matrix"] for number in row)
        transform = ElementTree.SubElement(parent, "transform", name=name)
        ElementTree.SubElement(transform, "matrix", value=numbers)
    elif isinstance(value, dict) and value["type"] == "rgb":
        words = ", ".join(map(repr, value["value"]))
        ElementTree.SubElement(parent, "rgb", name=name, value=words)
    elif isinstance(value, dict) and value["type"] == "ref":
        ElementTree.SubElement(parent, "ref", name=name, id=value["id"])
    elif isinstance(value, dict):
        # A plugin that has a key of its own keeps it, so that others can refer to it.
        plugin = ElementTree.SubElement(parent, _TAGS[name.rstrip("0123456789")])
        plugin.set("type", value["type"])
        if parent.tag == "scene":
            plugin.set("id", name)
        elif plugin.tag in ("rfilter", "phase"):
            plugin.set("name", name)
        for key, entry in value.items():
            if key not in ("type", "id"):
                _add(plugin, key, entry)
    elif name in _POINTS:
        x, y, z = map(repr, value)
        ElementTree.SubElement(parent, "point", name=name, x=x, y=y, z=z)
    else:
        tag = {str: "string", int: "integer", float: "float"}[type(value)]
        ElementTree.SubElement(parent, tag, name=name, value=str(value))
