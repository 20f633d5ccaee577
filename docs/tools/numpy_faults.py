# SPDX-License-Identifier: BSD-3-Clause
"""Faults that are set in a renderer of fifty lines of NumPy, and what the diagnosis says of them.

`python docs/tools/numpy_faults.py` renders a scene by marching rays, which shares no code with the
reference or with the hypotheses, once for each fault; adds 1 % of noise; lets the diagnosis say
what is wrong, without telling it what a pixel is; and writes `docs/data/numpy-faults.json`, from
which docs/diagnosed-engines.md has its table of confusion.
"""

import argparse
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs/data/numpy-faults.json"
_SIZE = (64, 48)
# edges of shadows fall within a step: fog of 8 x 8 pixels is within 0.2 % of that of many steps
_STEPS = 768
# where rays to the sky end [m]: of fog without attenuation 1e-4 of the light lies beyond
_FAR = 1e4
_SIDE = 3  # rays along a side of a pixel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lamp:
    """A point light, or a spot with a hard edge."""

    place: tuple[float, float, float]
    intensity: tuple[float, float, float]
    axis: tuple[float, float, float] | None = None
    cutoff: float = math.pi


@dataclass(frozen=True)
class Engine:
    """A renderer of fog above a floor with a ball, and what is set wrong in it."""

    lamps: tuple[Lamp, ...] = (
        Lamp((-0.85, 0.35, 2.15), (6.3, 5.6, 4.4)),
        Lamp((1.3, -0.9, 2.4), (9.0, 9.0, 12.0), (-0.25, 0.55, -1.0), math.radians(26)),
    )
    sigma_t: float = 0.17
    albedo: tuple[float, float, float] = (0.91, 0.88, 0.82)
    phase: Callable[[Array], Array] = lambda c: (1 - 0.35**2) / (1 + 0.35**2 - 0.7 * c) ** 1.5
    floor: tuple[float, float, float] = (0.41, 0.39, 0.36)
    ball: tuple[float, float, float] = (0.52, 0.31, 0.22)
    exposure: float = 1.0
    fog: tuple[float, ...] = (1.0, 1.0)  # factors on the fog of each lamp
    surface: float = 1.0
    shadows: tuple[bool, bool] = (True, True)  # in the fog, on surfaces
    # base and scale height of a density that falls exponentially [m]
    layer: tuple[float, float] | None = None
    start: float = 0.0
    end: float = math.inf
    planar: bool = False
    power: float = 2.0
    soft: float = 0.0  # what is added to the squared distance [m^2]
    reach: float = math.inf
    segments: tuple[float, float] = (1.0, 1.0)  # to the camera, from the light
    moved: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the first lamp, in the fog
    shifted: tuple[float, float] = (0.0, 0.0)  # of the fog [pixels]
    mixed: Callable[[Array, Array, Array], Array] = lambda fog, surface, left: fog + surface
    block: int = 1  # pixels along a side that share their fog
    steps: int = _STEPS

    def density(self, z: Array) -> Array:
        """Return the density at heights."""
        if self.layer is None:
            return np.ones_like(z)
        base, scale_height = self.layer
        return np.exp(-(z - base) / scale_height)


ORIGIN, TARGET, FOV = np.array([0.35, -5.15, 1.45]), np.array([0.05, 0.4, 0.85]), math.radians(49)
BALL, RADIUS, HALF = np.array([0.45, 0.6, 0.55]), 0.53, (8.3, 7.7)


def _triple(values: Any) -> str:
    return ", ".join(f"{value:g}" for value in values)


def scene_xml(engine: Engine) -> str:
    """Return the scene as Mitsuba reads it."""
    kind, sigma_t = "homogeneous", f'<rgb name="sigma_t" value="{engine.sigma_t}"/>'
    if engine.layer is not None:
        pairs = zip(("sigma_1", "z_1", "H_1"), (engine.sigma_t, *engine.layer))
        numbers = "".join(f'<float name="{name}" value="{value}"/>' for name, value in pairs)
        kind, sigma_t = (
            "heterogeneous",
            (
                '<volume type="heightfog" name="sigma_t"><transform name="to_world"><scale x="200" '
                'y="200" z="91"/>'
                f'<translate z="-1"/></transform>{numbers}</volume>'
            ),
        )
    lights = "".join(
        f'<emitter type="point" id="lamp-{n}"><point name="position" '
        f'value="{_triple(lamp.place)}"/>'
        f'<rgb name="intensity" value="{_triple(lamp.intensity)}"/></emitter>'
        if lamp.axis is None
        else f'<emitter type="spot" id="lamp-{n}"><transform name="to_world"><lookat origin="{_triple(lamp.place)}" '
        f'target="{_triple(np.add(lamp.place, lamp.axis))}" up="0, 1, 0"/></transform><rgb '
        'name="intensity" '
        f'value="{_triple(lamp.intensity)}"/><float name="cutoff_angle" '
        f'value="{math.degrees(lamp.cutoff):.9g}"/>'
        f'<float name="beam_width" value="{math.degrees(lamp.cutoff):.9g}"/></emitter>'
        for n, lamp in enumerate(engine.lamps)
    )
    return f"""<scene version="3.0.0">
    <medium type="{kind}" id="fog">{sigma_t}
        <rgb name="albedo" value="{_triple(engine.albedo)}"/>
        <phase type="hg"><float name="g" value="0.35"/></phase></medium>
    <sensor type="perspective"><float name="fov" value="49"/><ref name="medium" id="fog"/>
        <transform name="to_world">
            <lookat origin="{_triple(ORIGIN)}" target="{_triple(TARGET)}" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="{_SIZE[0]}"/>
            <integer name="height" value="{_SIZE[1]}"/></film></sensor>
    {lights}
    <shape type="rectangle" id="floor">
        <transform name="to_world"><scale x="{HALF[0]}" y="{HALF[1]}" z="1"/></transform>
        <bsdf type="twosided">
            <bsdf type="diffuse"><rgb name="reflectance" value="{_triple(engine.floor)}"/></bsdf></bsdf>
    </shape>
    <shape type="sphere" id="ball"><point name="center" value="{_triple(BALL)}"/>
        <float name="radius" value="{RADIUS}"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="{_triple(engine.ball)}"/></bsdf></shape>
</scene>"""


def _rays(positions: Array) -> tuple[Array, Array]:
    """Return unit directions through places on the film, and the axis of the camera."""
    ahead = (TARGET - ORIGIN) / np.linalg.norm(TARGET - ORIGIN)
    right = np.cross(ahead, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    up, half = np.cross(right, ahead), math.tan(0.5 * FOV)
    across, along = (
        half * (2 * positions[:, 0] / _SIZE[0] - 1),
        half * (_SIZE[1] - 2 * positions[:, 1]) / _SIZE[0],
    )
    way = ahead + across[:, None] * right + along[:, None] * up
    return way / np.linalg.norm(way, axis=1)[:, None], ahead


def _to_ball(origin: Array, way: Array) -> Array:
    """Return the distance at which lines with unit directions enter the ball;
    infinite where they miss it.
    """
    along = np.sum((BALL - origin) * way, axis=-1)
    inner = along**2 - np.sum((BALL - origin) ** 2, axis=-1) + RADIUS**2
    near = along - np.sqrt(np.maximum(inner, 0))
    return np.where((inner > 0) & (near > 1e-6), near, np.inf)


def _light(engine: Engine, lamp: Lamp, point: Array, shadows: bool) -> tuple[Array, Array, Array]:
    """Return the light of a lamp at points without its colour, the unit direction
    to it, and the distance.
    """
    way = np.array(lamp.place) - point
    r = np.linalg.norm(way, axis=-1)
    way = way / r[..., None]
    sent = (r**engine.power + engine.soft) ** -1.0 * np.maximum(1 - (r / engine.reach) ** 4, 0) ** 2
    if lamp.axis is not None:
        axis = np.array(lamp.axis) / np.linalg.norm(lamp.axis)
        sent = sent * (-(way @ axis) > math.cos(lamp.cutoff))
    if shadows:
        # The floor has an edge: beyond it light reaches points below.
        below = point[..., 2] < -1e-6
        up = np.where(below, -point[..., 2] / np.where(below, way[..., 2], 1), 0)
        on_floor = (np.abs((point + up[..., None] * way)[..., :2]) <= HALF).all(axis=-1)
        sent = sent * (_to_ball(point, way) > r) * ~(below & on_floor)
    return sent, way, r


def _depth(engine: Engine, low: Array, high: Array, length: Array) -> Array:
    """Return the optical depth of a straight path between two heights."""
    if engine.layer is None:
        return engine.sigma_t * length
    parts = (np.arange(16) + 0.5) / 16
    mean = sum(engine.density(low + part * (high - low)) for part in parts) / len(parts)
    return engine.sigma_t * length * mean


def _layers(engine: Engine, positions: Array) -> tuple[Array, Array, Array]:
    """Return fog, surface and transmittance of rays."""
    way, axis = _rays(positions)
    with np.errstate(divide="ignore"):
        floor = np.where(way[:, 2] < 0, -ORIGIN[2] / way[:, 2], np.inf)
    place = ORIGIN + np.where(np.isfinite(floor), floor, 0)[:, None] * way
    floor = np.where((np.abs(place[:, :2]) <= HALF).all(axis=1), floor, np.inf)
    ball = _to_ball(np.broadcast_to(ORIGIN, way.shape), way)
    distance = np.minimum(floor, ball)
    hit, point = (
        np.isfinite(distance),
        ORIGIN + np.where(np.isfinite(distance), distance, 0)[:, None] * way,
    )
    flat = way @ axis if engine.planar else 1.0
    seen = np.where(hit, distance * flat, _FAR)
    last = np.minimum(np.maximum(seen, engine.start), engine.end)
    normal = np.where((ball < floor)[:, None], (point - BALL) / RADIUS, [0, 0, 1.0])
    colour = np.where((ball < floor)[:, None], engine.ball, engine.floor)
    length = np.maximum(last - engine.start, 0)
    left = np.where(
        hit,
        np.exp(-engine.segments[0] * _depth(engine, ORIGIN[2] + 0 * last, point[:, 2], length)),
        0,
    )
    surface, fog = np.zeros((len(way), 3)), np.zeros((len(way), 3))
    for lamp in engine.lamps:
        sent, to, r = _light(engine, lamp, point + 1e-7 * normal, engine.shadows[1])
        falls = sent * np.maximum(np.sum(normal * to, axis=1), 0) * hit
        falls = (
            falls
            * left
            * np.exp(-engine.segments[1] * _depth(engine, point[:, 2], lamp.place[2] + 0 * r, r))
        )
        surface += falls[:, None] * colour / math.pi * lamp.intensity
    for number, given in enumerate(engine.lamps):
        lamp = (
            replace(given, place=tuple(np.add(given.place, engine.moved))) if number == 0 else given
        )
        # Steps even in the angle from the lamp: the light near it is then as smooth as elsewhere.
        foot = np.sum((np.array(lamp.place) - ORIGIN) * way, axis=1)
        height = np.linalg.norm(ORIGIN + foot[:, None] * way - lamp.place, axis=1)
        ends = np.arctan2(engine.start - foot, height), np.arctan2(last - foot, height)
        for step in range(engine.steps):
            angle = ends[0] + (step + 0.5) / engine.steps * (ends[1] - ends[0])
            x = foot + height * np.tan(angle)
            size = height / np.cos(angle) ** 2 * (ends[1] - ends[0]) / engine.steps
            here = ORIGIN + x[:, None] * way
            sent, to, r = _light(engine, lamp, here, engine.shadows[0])
            depth = engine.segments[0] * _depth(
                engine, ORIGIN[2] + 0 * x, here[:, 2], np.maximum(x - engine.start, 0)
            )
            depth = depth + engine.segments[1] * _depth(
                engine, here[:, 2], lamp.place[2] + 0 * r, r
            )
            value = (
                sent
                * engine.phase(np.sum(to * way, axis=1))
                * engine.density(here[:, 2])
                * np.exp(-depth)
                * np.maximum(size, 0)
            )
            scale = engine.fog[number] * engine.sigma_t / (4 * math.pi)
            fog += scale * value[:, None] * np.multiply(engine.albedo, lamp.intensity)
    return fog, engine.surface * surface, left[:, None]


def rendered(engine: Engine, *, area: bool, noise: float, seed: int) -> Array:
    """Return the image of an engine, (height, width, 3), with relative noise."""
    row, column = np.divmod(np.arange(_SIZE[0] * _SIZE[1]), _SIZE[0])
    side = _SIDE if area else 1
    cells = (np.arange(side) + 0.5) / side
    total = np.zeros((len(row), 3))
    for across in cells:
        for along in cells:
            film = np.stack([column + across, row + along], axis=1)
            fog, surface, left = _layers(engine, film)
            if any(engine.shifted) or engine.block > 1:
                film = film - np.array(engine.shifted)
                film = (
                    film // engine.block * engine.block
                    + 0.5 * (engine.block > 1)
                    + film % 1.0 * (engine.block == 1)
                )
                fog, _, left = _layers(engine, film)
            total += engine.mixed(fog, surface, left) * engine.exposure / side**2
    image = total.reshape(_SIZE[1], _SIZE[0], 3)
    return image * (1 + relative_noise(noise, seed))


def relative_noise(size: float, seed: int) -> Array:
    """Return the relative noise of an image, (height, width, 1): all
    channels of a pixel share it.
    """
    return size * np.random.default_rng(seed).standard_normal((_SIZE[1], _SIZE[0], 1))


def _curve(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(((v + 0.055) / 1.055) ** 2.4 for v in values)


RIGHT = Engine()
FAULTS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("right", "nothing", {}),
    ("factor", "twice as bright", {"exposure": 2.0}),
    ("fog-factor", "the fog 8.3 times as bright", {"fog": (8.3, 8.3)}),
    ("surface-factor", "surfaces pi times as bright", {"surface": math.pi}),
    ("fog-factor", "the fog of the spot 3 times as bright", {"fog": (1.0, 3.0)}),
    ("extinction", "the extinction 1.5 times", {"sigma_t": 1.5 * 0.17}),
    ("extinction", "a mean free path for the extinction", {"sigma_t": 1 / 0.17}),
    ("albedo", "the albedo decoded by sRGB", {"albedo": _curve((0.91, 0.88, 0.82))}),
    (
        "g-sign",
        "g with the other sign",
        {"phase": lambda c: (1 - 0.35**2) / (1 + 0.35**2 + 0.7 * c) ** 1.5},
    ),
    ("phase", "an isotropic phase function", {"phase": lambda c: np.ones_like(c)}),
    (
        "phase",
        "Schlick's phase function, k = g",
        {"phase": lambda c: (1 - 0.35**2) / (1 - 0.35 * c) ** 2},
    ),
    ("phase", "Rayleigh's phase function", {"phase": lambda c: 0.75 * (1 + c * c)}),
    ("light-path", "the way from the light not attenuated", {"segments": (1.0, 0.0)}),
    ("camera-path", "the way to the camera not attenuated", {"segments": (0.0, 1.0)}),
    ("near-plane", "no fog before 0.5 m", {"start": 0.5}),
    ("fog-end", "no fog beyond 6 m", {"end": 6.0}),
    ("right", "depth along the axis: less than the comparison sees", {"planar": True}),
    ("height-fog", "density falls to 1/e in 1.1 m", {"layer": (0.0, 1.1)}),
    ("distance-law", "one over the distance", {"power": 1.0}),
    ("light-range", "lights end at 5 m", {"reach": 5.0}),
    ("no-shadow", "no shadows", {"shadows": (False, False)}),
    ("right", "no shadows in the fog: less than the comparison sees", {"shadows": (False, True)}),
    ("light-lag", "the fog lit from where the lamp was", {"moved": (0.25, 0.1, 0.0)}),
    ("fog-shift", "the fog 1.5 pixels too far right", {"shifted": (1.5, 0.0)}),
    (
        "opacity",
        "the fog times its opacity",
        {"mixed": lambda fog, surface, left: fog * (1 - left) + surface},
    ),
    (
        "opacity",
        "surfaces attenuated twice",
        {"mixed": lambda fog, surface, left: fog + surface * left},
    ),
    (
        "ambient",
        "ambient light in the fog",
        {"mixed": lambda fog, surface, left: fog + surface + (1 - left) * [0.02, 0.03, 0.05]},
    ),
    ("unexplained", "the fog at a quarter of the resolution", {"block": 4}),
    ("unexplained", "five steps a ray", {"steps": 5}),
)

LAYERED = replace(RIGHT, sigma_t=0.31, layer=(0.2, 1.3))
FAULTS_OF_LAYERS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("right", "nothing, in height fog", {}),
    (
        "homogeneous",
        "homogeneous fog where height fog was asked for",
        {"layer": None, "sigma_t": 0.11},
    ),
    ("scale-height", "a falloff for the scale height", {"layer": (0.2, 1 / 1.3)}),
    ("scale-height", "density halves in the scale height", {"layer": (0.2, 1.3 / math.log(2))}),
    ("scale-height", "the scale height 1.8 times", {"layer": (0.2, 1.8 * 1.3)}),
    (
        "height-fog",
        "the scale height 0.7 times, and the base 0.6 m too high",
        {"layer": (0.8, 0.7 * 1.3)},
    ),
    (
        "camera-path",
        "the way to the camera not attenuated, in height fog",
        {"segments": (0.0, 1.0)},
    ),
)
LAWS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("distance-law", "one over the squared distance and 0.4 m^2", {"soft": 0.4}),
    ("no-extinction", "nothing attenuated", {"segments": (0.0, 0.0)}),
)
CASES = tuple(
    (engine, *fault)
    for engine, faults in ((RIGHT, FAULTS), (LAYERED, FAULTS_OF_LAYERS), (RIGHT, LAWS))
    for fault in faults
)


def main() -> None:
    """Render, diagnose and write the record."""
    from airlight.reports.machine.environment import activate

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only", nargs="*", type=int, help="numbers of faults; others keep their rows"
    )
    parser.add_argument("--noise", type=float, default=0.01, help="relative noise of every pixel")
    chosen = parser.parse_args()
    activate()
    import tempfile

    from airlight.reference.scene.read import read_reference
    from airlight.reference.storage.exr import Image
    from airlight.reference.storage.files import write_text
    from airlight.validation.engine.diagnose import diagnose_image
    from airlight.validation.engine.prediction import SceneLight
    from airlight.validation.scenes.loading import load_scene

    scenes = {}
    with tempfile.TemporaryDirectory() as folder:
        for engine in (RIGHT, LAYERED):
            path = Path(folder) / "scene.xml"
            path.write_text(scene_xml(engine), encoding="utf-8")
            loaded = load_scene(str(path), _SIZE)
            scenes[engine] = loaded, SceneLight(read_reference(loaded.scene))
    old = json.loads(RECORD.read_text(encoding="utf-8"))["rows"] if RECORD.exists() else []
    rows = {row["number"]: row for row in old}
    for number, (engine, injected, words, given) in enumerate(CASES):
        if chosen.only and number not in chosen.only:
            continue
        area = number % 2 == 1
        loaded, light = scenes[engine]
        image = rendered(replace(engine, **given), area=area, noise=chosen.noise, seed=number)
        said = diagnose_image(Image({"total": image}), loaded, light=light)
        rows[number] = {
            "number": number,
            "injected": injected,
            "words": words,
            "pixel": "area" if area else "centre",
            "first": said.first,
            "right": said.first == injected,
            "pixel_found": said.pixel,
            "says": said.ranked[0].words
            if said.first != "unexplained"
            else f"the error lies {said.place}",
            "together": list(said.ranked[0].together),
            "residual": said.residual,
            "left": said.left,
        }
        print(json.dumps(rows[number]), flush=True)
        record = {"measured": f"{datetime.now(UTC):%Y-%m-%d}", "noise": chosen.noise}
        record["rows"] = [rows[each] for each in sorted(rows)]
        write_text(RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
