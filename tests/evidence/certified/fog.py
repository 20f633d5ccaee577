# SPDX-License-Identifier: BSD-3-Clause
"""The certified fog scenes: airlight of 12 x 64 camera rays to 12 digits, with bounds
and lit intervals, as JSON.

    python -m tests.evidence.certified.fog      # writes validation/certified/certified_fog.json, in about ten minutes

The radiance of a ray is the sum over lights and lit intervals

    L = albedo sigma_t / (4 pi)  sum I J(x0, x1),

with the intervals in closed form (`tests.evidence.certified.intervals`, 40 digits) and each J by
two quadratures at two precisions that must agree to 15 digits (`integral.py`). All terms are
positive, so the sum keeps those digits; what is left of the error is the rounding to the 12 digits
that are written, and that is the bound.

In the outer part of a spot the intensity falls off with the angle beta from its axis. In the plane
of ray and light the point at angle theta has cos(scattering angle) = -sin(theta) and lies in the
direction sin(theta) d + cos(theta) n, hence

    c = cos(scattering angle),      cos(beta) = -c (axis . d) + sqrt(1 - c^2) (axis . n):

the fall-off is a function of c, as the phase function is, and their product takes
its place (`SpotPhase`).
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mpmath import mp, mpf

from airlight.analytic.phase import PhaseFunction, phase_from_words
from airlight.validation.certified.files import FOLDER
from tests.evidence.certified.integral import integrate_certified
from tests.evidence.certified.intervals import (
    Number,
    Vector,
    cross,
    dot,
    lit_parts,
    minus,
    ray_end,
    spot_cones,
    unit,
    vector,
)
from tests.evidence.certified.model import (
    SIZE,
    FogBox,
    FogLight,
    FogScene,
    FogScreen,
    FogSphere,
    fog_scenes,
    mitsuba_dict,
)

SCHEMA = "airlight-certified-fog/1"
DIGITS = 12  #: significant digits of a radiance
_GEOMETRY = 40  # digits carried by intervals
_INTEGRAL = 15  # digits on which both quadratures agree
_DISTANCE = 17  # digits of a distance that is written

_CONVENTIONS = {
    "radiance": "airlight: light scattered exactly once in the medium, RGB [W/(m^2 sr)]",
    "bound": "largest absolute error of each radiance",
    "distance": "to the first occluder along the ray [m]; inf: none, the ray is unbounded",
    "lit": "for each light, where the lit intervals of the ray begin and end [m]",
    "pixels": "rays through the pixel centres, row by row from the top left",
    "phase": "its mean over the sphere is 1; with c the cosine of the scattering angle, +1 forward: isotropic 1; "
    "rayleigh 3 (1 + c^2)/4; hg (1 - g^2)/(1 + g^2 - 2 g c)^1.5",
    "intensity": "radiant intensity [W/sr], of a spot that on its axis; from `beam` to `cutoff` [degrees off the axis] "
    "it falls linearly in the angle to 0",
    "medium": (
        "homogeneous, without bounds; sigma_t is the extinction [1/m], the scattering coefficient "
        "albedo sigma_t"
    ),
    "occluders": "black; sphere: centre, radius; box: centre + a u + b v + c w with -1 <= a, b, c <= 1; screen: the "
    "same with u and v alone; half_edges holds u, v, w",
    "matrix": (
        "in a Mitsuba dictionary {'matrix': rows} stands for a transform, applied to column vectors"
    ),
    "numbers": (
        "inputs are JSON numbers, exact in float32 (directions: in float64); results are decimal "
        "words"
    ),
}


@dataclass(frozen=True)
class CertifiedPixel:
    """One ray, in decimal words."""

    distance: str  #: to the first occluder [m]
    radiance: tuple[str, ...]  #: RGB [W/(m^2 sr)]
    bound: tuple[str, ...]  #: of the absolute errors
    #: for each light: where lit intervals begin and end [m]
    lit: tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True)
class SpotPhase(PhaseFunction):
    """A phase function times the fall-off of a spot between beam and cut-off, along one ray."""

    phase: PhaseFunction
    axial: Any  #: axis . direction
    across: Any  #: axis . n, n the unit vector from the light to the foot point
    angles: tuple[float, float]  #: beam and cut-off [degrees]

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath at its current precision."""
        c = mpf(cos_scatter)
        cos_axis = -c * self.axial + mp.sqrt(1 - c * c) * self.across
        beam, cutoff = (mp.radians(mpf(angle)) for angle in self.angles)
        return self.phase.mp(c) * (cutoff - mp.acos(cos_axis)) / (cutoff - beam)


def directions(scene: FogScene) -> tuple[tuple[float, ...], ...]:
    """Return the unit directions through the pixel centres, row by row, as float64 numbers.

    With z the forward axis and a half width of tan(fov/2), the camera's own direction of pixel
    (row, column) is ((7/2 - column) w, (7/2 - row) w, 1), w = 2 tan(fov/2)/8: its x axis points
    left. The rounded numbers count as exact.
    """
    with mp.workdps(_GEOMETRY):
        width = 2 * mp.tan(mp.radians(mpf(scene.fov)) / 2) / SIZE
        rows = [vector(row[:3]) for row in scene.camera[:3]]
        unit_directions = []
        for pixel in range(SIZE * SIZE):
            row, column = divmod(pixel, SIZE)
            half = mpf(SIZE - 1) / 2
            own = ((half - column) * width, (half - row) * width, mpf(1))
            unit_directions.append(
                tuple(
                    float(value)
                    for value in unit((dot(rows[0], own), dot(rows[1], own), dot(rows[2], own)))
                )
            )
    return tuple(unit_directions)


def certify_pixel(scene: FogScene, direction: Sequence[float]) -> CertifiedPixel:
    """Certify the airlight along one ray from the scene's camera.

    Valid for cameras and lights outside of all occluders, and rays that do not meet a light. Takes
    about a third of a second for each light and colour of the extinction.
    """
    with mp.workdps(_GEOMETRY):
        origin, d = vector([row[3] for row in scene.camera[:3]]), unit(vector(direction))
        end = ray_end(origin, d, scene.occluders)
        total, lit = [mp.zero] * 3, []
        for light in scene.lights:
            parts = lit_parts(origin, d, end=end, light=light, occluders=scene.occluders)
            lit.append(_joined(parts))
            for channel, integral in enumerate(_integrals(scene, light, (origin, d), parts)):
                factor = (
                    mp.mpf(scene.albedo[channel])
                    * scene.sigma_t[channel]
                    * light.intensity[channel]
                    / (4 * mp.pi)
                )
                total[channel] += factor * integral
        words = [_rounded(value) for value in total]
        intervals = tuple(
            tuple((_word(low), _word(high)) for low, high in intervals_of_light)
            for intervals_of_light in lit
        )
        return CertifiedPixel(
            _word(end), tuple(w for w, _ in words), tuple(b for _, b in words), intervals
        )


def _integrals(
    scene: FogScene, light: FogLight, ray: tuple[Vector, Vector], parts: list
) -> list[Number]:
    """Return the sum of J over the lit parts of a ray for each colour [1/m]."""
    origin, d = ray
    towards = minus(vector(light.position), origin)
    foot, across = dot(towards, d), cross(towards, d)
    height = mp.sqrt(dot(across, across))
    plain = phase_from_words(scene.phase, g=scene.g)
    faint = plain
    if light.beam < light.cutoff:
        (axis, _), *_ = spot_cones(light)
        normal = cross(across, d)  # from the light to the foot point: (t x d) x d = (t . d) d - t
        faint = SpotPhase(
            plain, dot(axis, d), dot(axis, normal) / height, (light.beam, light.cutoff)
        )
    integrals: list[Number] = []
    for channel, sigma_t in enumerate(scene.sigma_t):
        if channel and sigma_t == scene.sigma_t[0]:
            integrals.append(integrals[0])
            continue
        terms = [
            integrate_certified(
                foot, height, low, high, sigma_t, faint if dim else plain, digits=_INTEGRAL
            )
            for low, high, dim in parts
        ]
        integrals.append(mp.fsum(terms))
    return integrals


def _joined(parts: list) -> list[tuple[Number, Number]]:
    """Return lit intervals without regard to how much of a spot shines on them."""
    joined: list[tuple[Number, Number]] = []
    for low, high, _ in parts:
        if joined and joined[-1][1] == low:
            low = joined.pop()[0]
        joined.append((low, high))
    return joined


def _word(value: Number) -> str:
    return "inf" if mp.isinf(value) else mp.nstr(value, _DISTANCE, strip_zeros=True)


def _rounded(value: Number) -> tuple[str, str]:
    """Return a radiance in 12 digits and the bound of its error: half a unit of the
    last digit, and 1e-14 of it.
    """
    if value == 0:
        return "0", "0"
    exponent = int(mp.floor(mp.log10(value)))
    bound = mpf(10) ** (exponent + 1 - DIGITS) / 2 + value * mpf("1e-14")
    mantissa = mp.ceil(bound * mpf(10) ** (1 - (exponent - DIGITS)))
    word = mp.nstr(value, DIGITS, min_fixed=0, max_fixed=0, strip_zeros=False)
    return word, f"{int(mantissa)}e{exponent - DIGITS - 1}"


def certified_fog(scenes: Sequence[FogScene]) -> dict[str, Any]:
    """Certify all pixels of scenes, and return the data of the file."""
    certified = []
    for scene in scenes:
        rays = directions(scene)
        pixels = [asdict(certify_pixel(scene, direction)) for direction in rays]
        certified.append(scene_data(scene, rays) | {"pixels": pixels})
    return {"schema": SCHEMA, "conventions": _CONVENTIONS, "scenes": certified}


def scene_data(scene: FogScene, rays: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Return all of a scene but its pixels, as the file holds it."""
    medium = {"sigma_t": scene.sigma_t, "albedo": scene.albedo, "phase": scene.phase}
    return {
        "name": scene.name,
        "words": scene.words,
        "mitsuba": mitsuba_dict(scene),
        "camera": {"origin": [row[3] for row in scene.camera[:3]], "directions": rays},
        "medium": medium | ({"g": scene.g} if scene.phase == "hg" else {}),
        "lights": [_light_data(light) for light in scene.lights],
        "occluders": [_occluder_data(shape) for shape in scene.occluders],
    }


def _light_data(light: FogLight) -> dict[str, Any]:
    data = {"type": "point", "position": light.position, "intensity": light.intensity}
    if light.matrix is None:
        return data
    axis = [row[2] for row in light.matrix[:3]]
    return data | {"type": "spot", "axis": axis, "cutoff": light.cutoff, "beam": light.beam}


def _occluder_data(shape: FogSphere | FogBox | FogScreen) -> dict[str, Any]:
    names = {FogSphere: "sphere", FogBox: "box", FogScreen: "screen"}
    return {"type": names[type(shape)]} | asdict(shape)


def to_json(data: dict[str, Any]) -> str:
    """Return the data as JSON, one pixel or ray a line so that two versions can be compared."""
    scenes = []
    for scene in data["scenes"]:
        lines = [f"  {json.dumps(name)}: {_lines(name, value)}" for name, value in scene.items()]
        scenes.append(" {\n" + ",\n".join(lines) + "\n }")
    head = "".join(
        f"{json.dumps(name)}: {json.dumps(data[name], indent=1)},\n"
        for name in ("schema", "conventions")
    )
    return "{" + head + '"scenes": [\n' + ",\n".join(scenes) + "\n]}\n"


def _lines(name: str, value: Any) -> str:
    if name == "pixels":
        return "[\n" + ",\n".join(f"   {json.dumps(pixel)}" for pixel in value) + "\n  ]"
    if name == "camera":
        rays = ",\n".join(f"   {json.dumps(ray)}" for ray in value["directions"])
        return f'{{"origin": {json.dumps(value["origin"])}, "directions": [\n{rays}\n  ]}}'
    return json.dumps(value)


if __name__ == "__main__":
    (FOLDER / "certified_fog.json").write_text(to_json(certified_fog(fog_scenes())))
