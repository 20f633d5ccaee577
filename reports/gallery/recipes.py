# SPDX-License-Identifier: BSD-3-Clause
"""Which pictures the gallery has. Nothing heavy is imported at the top: the command lists them for its help."""

from collections.abc import Iterator
from dataclasses import dataclass

SIZE, SMALL = (640, 480), (480, 360)
SAMPLES = 16
_SOFT = ("ray-march", ("shadow=map", "steps=64", "points=16"), 4)  # each light point takes as long as a light
_CLOUDS = ("cloud-octaves", (), 1)  # seconds a frame
#: How a scene is shown where `shadow-planes` would be slow or refused: method, settings, rays a pixel.
_OTHERWISE = {
    "tangle": ("light-volumes", ("map=1024",), SAMPLES),
    **dict.fromkeys(("penumbra-plane", "fence", "soft-hall", "overlap"), _SOFT),
    **dict.fromkeys(
        ("cloud-slab", "stratocumulus", "cumulus", "cumulus-detail", "step-cloud", "ring", "two-lobes"), _CLOUDS
    ),
}
#: The scene in which a method is shown, and its settings, where that is not `hall` and its defaults.
_METHOD_SCENES = {
    "soft-shafts": ("penumbra-plane", ()),
    "cloud-octaves": ("cumulus", ()),
    "cloud-collectors": ("stratocumulus", ()),
}
#: Methods without a map of their errors: the truth of clouds takes hours without noise.
_NO_ERROR = ("cloud-octaves", "cloud-collectors")
#: Clouds in other lights and from elsewhere, by `cloud-collectors`: the scene, and what is changed in it.
_VIEWS = {
    "cloud-noon": ("cumulus", ("light.direction=0.13,0.17,-0.98",)),
    "cloud-dusk": ("cumulus", ("light.direction=0.93,0.34,-0.13", "light.irradiance=3.3,1.7,0.67")),
    "cloud-silver-lining": ("cumulus", ("light.direction=0.11,-0.95,-0.29",)),
    "cloud-glory": (
        "stratocumulus",
        ("camera.origin=917,-791,2411", "camera.target=-194,-281,1090", "camera.fov=17"),
    ),
    "cloud-fogbow": (
        "stratocumulus",
        ("camera.origin=517,-491,1911", "camera.target=-594,19,590", "camera.fov=97"),
    ),
}
TUTORIAL = "gate.xml"  #: the scene of docs/tutorial.md, in which it stands
STRIP = ("hall", "clutter", "three-media", "windows")  #: at the top of the README


@dataclass(frozen=True)
class Picture:
    """A picture of the gallery."""

    name: str
    #: "scene", "method" (what it renders), "error", "sketch", "strip" or "page" (of a report)
    kind: str
    scene: str  #: that it shows; the first of a strip
    method: str = ""
    settings: tuple[str, ...] = ()
    samples: int = 1  #: rays a pixel
    changes: tuple[str, ...] = ()  #: of the scene, as `--change` takes them

    @property
    def file(self) -> str:
        """The name of its file: JPEG for what is rendered, PNG where colours and lines must stay as they are."""
        return f"{self.name}.{'png' if self.kind in ('error', 'sketch') else 'jpg'}"

    @property
    def command(self) -> str:
        """What a reader types to see the same."""
        if self.kind not in ("scene", "method"):
            return f"airlight gallery {self.name}"
        width, height = SIZE if self.kind == "scene" else SMALL
        words = [f"airlight render {self.scene} --method {self.method}", *(f"--set {word}" for word in self.settings)]
        words += [f"--change {word}" for word in self.changes]
        words += [f"--size {width}x{height}", f"--samples {self.samples}" if self.samples > 1 else ""]
        return " ".join([*filter(None, words), f"--preview {self.scene.removesuffix('.xml')}.png"])


def scene_picture(scene: str) -> Picture:
    """Return the picture of a built-in scene."""
    method, settings, samples = _OTHERWISE.get(scene, ("shadow-planes", (), SAMPLES))
    return Picture(f"scene-{scene}", "scene", scene, method, settings, samples)


def method_pictures(method: str) -> tuple[Picture, ...]:
    """Return the pictures of a method: what it renders, the error of that, and how it works."""
    scene, settings = _METHOD_SCENES.get(method, ("hall", ()))
    about = (scene, method, settings)
    return (
        Picture(f"method-{method}", "method", *about),
        Picture(f"method-{method}-error", "error", *about),
        Picture(f"method-{method}-sketch", "sketch", "sphere-spot", method),
    )


def pictures() -> Iterator[Picture]:
    """Yield all pictures, in the order in which they are made."""
    from realtime.methods.registry import METHODS
    from reports.gallery.sketches import SKETCHES
    from validation.scenes.registry import SCENES

    yield from map(scene_picture, SCENES)
    for method in METHODS:
        rendered, error, sketch = method_pictures(method)
        yield from (rendered,) if method in _NO_ERROR else (rendered, error)
        if method in SKETCHES:
            yield sketch
    for name, (scene, changes) in _VIEWS.items():
        yield Picture(name, "method", scene, "cloud-collectors", changes=changes)
    yield Picture("strip", "strip", STRIP[0])
    yield Picture("report-page", "page", "")
    yield Picture("tutorial-gate", "scene", TUTORIAL, "shadow-planes", (), SAMPLES)
