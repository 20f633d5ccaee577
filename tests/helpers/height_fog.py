# SPDX-License-Identifier: BSD-3-Clause
"""The certified rays of height fog, and fog and rays drawn at random for the laws."""

import csv
from dataclasses import dataclass

import numpy as np

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.height_fog import (
    HeightFog,
    HeightRays,
    Layer,
    height_fog_segments,
    height_fog_sun,
)
from airlight.analytic.phase import HenyeyGreenstein, PhaseFunction
from airlight.validation.certified.files import certified_data

#: Two layers between a floor under the ground and a cap.
FOG = """<volume type="heightfog" name="sigma_t">
    <float name="sigma_1" value="0.13"/><float name="z_1" value="0.3"/><float name="H_1" value="2.7"/>
    <float name="sigma_2" value="0.02"/><float name="z_2" value="1.3"/><float name="H_2" value="9.7"/>
    <transform name="to_world"><scale x="40" y="40" z="43"/><translate x="-20" y="-20" z="-0.5"/></transform>
</volume>"""
LAMP = """<emitter type="point" id="lamp"><point name="position" x="0.4" y="0.9" z="4.7"/>
    <rgb name="intensity" value="37, 31, 23"/></emitter>"""
SPOT = """<emitter type="spot" id="spot">
    <transform name="to_world"><lookat origin="-3.1, 3.3, 6.2" target="-2.7, 0.2, 0" up="0, 1, 0"/></transform>
    <rgb name="intensity" value="61, 71, 97"/>
    <float name="cutoff_angle" value="27"/><float name="beam_width" value="17"/></emitter>"""
SUN = """<emitter type="directional" id="sun"><vector name="direction" x="0.5" y="0.3" z="-0.45"/>
    <rgb name="irradiance" value="3, 2.6, 2.1"/></emitter>"""


@dataclass(frozen=True)
class Row:
    """A ray of the file."""

    tag: str
    sun: bool
    fog: HeightFog
    phase: PhaseFunction
    origin: np.ndarray
    direction: np.ndarray
    light: np.ndarray  #: [m], or the unit direction towards the sun
    x0: float
    x1: float
    value: float

    def airlight(self, **how) -> float:
        """K by the module under test."""
        return airlight(
            self.fog,
            self.phase,
            self.origin,
            self.direction,
            self.light,
            self.x0,
            self.x1,
            self.sun,
            **how,
        )


def rows() -> list[Row]:
    with certified_data("height_fog_rays.csv").open(newline="") as file:
        return [_row(cells) for cells in csv.DictReader(file)]


def _row(cells) -> Row:
    number = {
        name: float(cell) for name, cell in cells.items() if name not in ("tag", "light", "value")
    }
    origin, direction, light = (
        np.array([number[point + axis] for axis in "xyz"]) for point in "odl"
    )
    sun = cells["light"] == "sun"
    layers = tuple(Layer(*(number[f"{name}_{i}"] for name in ("sigma", "z", "H"))) for i in (1, 2))
    return Row(
        cells["tag"],
        sun,
        HeightFog(layers, number["sigma_0"], bool(number["clamped"])),
        HenyeyGreenstein(number["g"]),
        origin,
        direction / np.linalg.norm(direction),
        light / np.linalg.norm(light) if sun else light,
        number["x0"],
        number["x1"],
        float(cells["value"]),
    )


def airlight(fog, phase, origin, direction, light, x0, x1, sun=False, **how) -> float:
    if sun:
        ends = {"sun": float(light[2]), "phase": phase(light @ direction)}
        return float(height_fog_sun(fog, origin[2], direction[2], x0, x1, **ends))
    foot, height = foot_and_height(origin, direction, light)
    rays = HeightRays(origin[2], direction[2], foot, height, light[2])
    return float(height_fog_segments(fog, rays, x0, x1, phase, **how)[0][0])


@dataclass(frozen=True)
class Drawn:
    """One ray in fog, drawn at random."""

    fog: HeightFog
    phase: PhaseFunction
    origin: np.ndarray
    direction: np.ndarray
    light: np.ndarray
    x0: float
    x1: float
    sun: bool

    def airlight(self, **how) -> float:
        return airlight(
            self.fog,
            self.phase,
            self.origin,
            self.direction,
            self.light,
            self.x0,
            self.x1,
            self.sun,
            **how,
        )


def drawn(seed: int, count: int = 40) -> list[Drawn]:
    """Return rays with lights and suns, in one or two layers, every other clamped; under
    suns without a constant.
    """
    random, found = np.random.default_rng(seed), []
    for number in range(count):
        sun = number % 2 == 1
        unit = random.normal(size=(2, 3))
        unit /= np.linalg.norm(unit, axis=1)[:, None]
        layers = tuple(
            Layer(
                *(
                    float(v)
                    for v in (
                        random.uniform(0.01, 0.3),
                        random.uniform(-3, 3),
                        random.uniform(0.7, 20),
                    )
                )
            )
            for _ in range(1 + number // 2 % 2)
        )
        fog = HeightFog(
            layers, 0.0 if sun else float(random.uniform(0, 0.05)), bool(number // 4 % 2)
        )
        light = random.normal(size=3) * 5
        if sun:
            light = unit[1] * [1, 1, 0] + [0, 0, random.uniform(0.05, 2)]
            light /= np.linalg.norm(light)
        x0 = float(random.uniform(0, 3))
        ends = x0, x0 + float(random.uniform(1, 12))
        phase = HenyeyGreenstein(float(random.uniform(-0.8, 0.8)))
        found.append(Drawn(fog, phase, random.normal(size=3) * 3, unit[0], light, *ends, sun))
    return found


def fog_xml(
    *parts: str, size: tuple[int, int] = (24, 18), fog: str = FOG, ball: str = "sphere"
) -> str:
    """Return a scene file: height fog over ground, a ball or a cube, and a
    post, and further parts.
    """
    width, height = size
    return f"""<scene version="3.0.0">
    <medium type="heterogeneous" id="fog">{fog}
        <rgb name="albedo" value="0.9, 0.85, 0.7"/>
        <phase type="hg"><float name="g" value="0.35"/></phase>
    </medium>
    <sensor type="perspective"><float name="fov" value="50"/><ref id="fog" name="medium"/>
        <transform name="to_world"><lookat origin="-13.7, -4.1, 2.3" target="0.3, 0.7, 2.9" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/></film>
    </sensor>
    <shape type="rectangle" id="ground"><transform name="to_world"><scale value="60"/></transform></shape>
    <shape type="{ball}" id="ball">
        <transform name="to_world"><scale value="0.7"/><translate x="-1.3" y="-0.4" z="2.1"/></transform></shape>
    <shape type="cube" id="post"><transform name="to_world">
        <scale x="0.3" y="0.3" z="2.1"/><translate x="1.1" y="2.1" z="2.1"/></transform></shape>
    {"".join(parts)}</scene>"""
