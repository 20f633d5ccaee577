# SPDX-License-Identifier: BSD-3-Clause
"""Terms of engines' equations: the samples of `single-scatter` against a march that is written here
from the equation of `reference.scene.model` alone, in float64.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import t

from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.airlight_sum import ball, box
from tests.helpers.density_grid import INSIDE, ROUGH, grid_xml, volume
from tests.helpers.height_fog import FOG as LAYERS
from tests.helpers.height_fog import LAMP, SPOT, SUN, fog_xml
from tests.helpers.scenes import clear_scene, spot, tiny_scene
from tests.helpers.suns import BRICK, PEARL, ball_over_floor, brick, pearl, sun, sunny

_BATCHES = 8
_SIZE = (12, 9)
G = 0.35

PHASES: dict[str, Callable] = {
    "isotropic": lambda c: np.ones_like(c),
    "rayleigh": lambda c: 3 * (1 + c * c) / 4,
    "hazy": lambda c: (1 + 9 * ((1 + c) / 2) ** 8) / 2,
    "murky": lambda c: (1 + 50 * ((1 + c) / 2) ** 32) * 33 / 83,
    "hg:-0.3": lambda c: _hg(c, -0.3),
    "scene": lambda c: _hg(c, G),
    "none": lambda c: _hg(c, G),
    "cornette-shanks": lambda c: _hg(c, G) * 1.5 * (1 + c * c) / (2 + G * G),
}


def _hg(c, g):
    return (1 - g * g) / (1 + g * g - 2 * g * c) ** 1.5


# Media for the march: extinction at places, and optical depths between places and out of the fog.


@dataclass(frozen=True)
class Even:
    """The same everywhere."""

    sigma_t: np.ndarray
    albedo: np.ndarray

    def sigma(self, p):
        return np.broadcast_to(self.sigma_t, p.shape)

    def depth(self, p, q):
        return self.sigma_t * np.linalg.norm(q - p, axis=-1)[:, None]

    def beyond(self, p, way):
        return np.full(p.shape, np.inf)

    def within(self, origin, direction, start, end):
        return start, end


@dataclass(frozen=True)
class Layers:
    """Two exponential layers between floor and cap; depths by 24 points of Gauss."""

    albedo: np.ndarray
    floor: float = -0.5
    cap: float = 42.5

    def density(self, z):
        total = 0.13 * np.exp(-(z - 0.3) / 2.7) + 0.02 * np.exp(-(z - 1.3) / 9.7)
        return np.where((z >= self.floor) & (z <= self.cap), total, 0)

    def sigma(self, p):
        return np.repeat(self.density(p[:, 2])[:, None], 3, axis=1)

    def depth(self, p, q):
        node, weight = np.polynomial.legendre.leggauss(24)
        low, high = np.broadcast_arrays(p[..., 2], q[..., 2])
        z = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * node
        mean = self.density(z) @ weight / 2
        return np.repeat((mean * np.linalg.norm(q - p, axis=-1))[:, None], 3, axis=1)

    def beyond(self, p, way):
        return self.depth(p, p + way * ((self.cap - p[:, 2]) / way[2])[:, None])

    def within(self, origin, direction, start, end):
        planes = sorted((z - origin[2]) / direction[2] for z in (self.floor, self.cap))
        return max(start, planes[0]), min(end, planes[1])


@dataclass(frozen=True)
class Body:
    """A medium in bounds, in vacuum."""

    chord: Callable
    sigma_t: np.ndarray
    albedo: np.ndarray
    phase: Callable

    def sigma(self, p):
        low, high = self.chord(p, np.broadcast_to([0.0, 0.0, 1.0], p.shape))
        return np.where(((low < 0) & (high > 0))[:, None], self.sigma_t, 0)

    def depth(self, p, q):
        way = q - p
        length = np.linalg.norm(way, axis=-1)
        low, high = self.chord(np.broadcast_to(p, way.shape), way / length[:, None])
        inside = np.clip(np.minimum(high, length) - np.maximum(low, 0), 0, None)
        return self.sigma_t * inside[:, None]

    def beyond(self, p, way):
        return self.depth(p, p + 100 * way)

    def within(self, origin, direction, start, end):
        low, high = self.chord(origin[None], direction[None])
        return max(start, low[0]), min(end, high[0])


@dataclass(frozen=True)
class Grid:
    """A density grid, of which the scene knows extinctions; depths by 32 midpoints."""

    medium: object

    @property
    def albedo(self):
        return self.medium.albedo

    def sigma(self, p):
        inside = np.all((p >= self.medium.low) & (p <= self.medium.high), axis=-1)
        return np.where(inside, self.medium.extinction(p), 0)[:, None] * np.ones(3)

    def depth(self, p, q):
        way, total = q - p, 0
        for k in range(32):
            total += self.sigma(p + way * ((k + 0.5) / 32)) / 32
        return total * np.linalg.norm(way, axis=-1)[:, None]

    def within(self, origin, direction, start, end):
        near, far = self.medium.crossed(origin, direction[None])
        return max(start, near[0]), min(end, far[0])


@dataclass(frozen=True)
class World:
    """A scene, its media for the march, and half the side and the height of its ground [m]."""

    scene: "mi.Scene"
    media: Callable
    ground: float = 0.0
    height: float = 0.0
    steps: int = 2048
    scale: float = 4.0  #: of the distances at which steps are as long as their mean [m]
    samples: int = 64
    most: float = 0.01  #: error that the test may have, of the airlight

    def blocked(self, p, way):
        """Where the ground stands in the way of light from unit directions, from above."""
        upwards = np.broadcast_to(way[..., 2], len(p))
        below = self.height - p[:, 2]
        reach = below / np.where(upwards > 0, upwards, 1)
        crossing = np.abs(p + way * reach[:, None])[:, :2].max(axis=1)
        return (below > 0) & (upwards > 0) & (crossing < self.ground)

    def surfaces(self, reference):
        """The distances of the ground along the rays."""
        fall = np.where(reference.direction[:, 2] < 0, reference.direction[:, 2], np.nan)
        reach = (self.height - reference.origin[2]) / fall
        places = reference.origin + reach[:, None] * reference.direction
        met = np.abs(places[:, :2]).max(axis=1) < self.ground
        return np.where(met, reach, np.inf)


# The equation.


def law(words, r):
    if words.kind == "softened":
        return words.scale / (r * r + words.length**2)
    if words.kind == "sphere":
        radius = words.length
        return 2 / (r * r + radius**2 + r * np.sqrt(r * r + radius**2))
    return np.maximum(r, words.length if words.kind == "clamped" else 0) ** -words.power


def window(words, r):
    if words is None:
        return 1
    s = r / words.end
    inside = {
        "quartic": (1 - s**4) ** 2,
        "fourth": 1 - s**4,
        "square": (1 - s**2) ** 2,
        "linear": 1 - s,
        "cut": 1,
    }[words.kind]
    return np.where(s < 1, inside, 0)


def edge(model, lamp, away):
    if lamp.axis is None:
        return 1
    c, (kind, power) = np.clip(away @ lamp.axis, -1, 1), model.spot_of
    angle, cc, cb = np.arccos(c), np.cos(lamp.cutoff), np.cos(lamp.beam)
    if kind == "angle":
        value = np.clip((lamp.cutoff - angle) / (lamp.cutoff - lamp.beam), 0, 1)
    elif kind == "rim":
        value = 1 - ((1 - c) / (1 - cc)) ** power
    else:
        s = np.clip((c - cc) / (cb - cc), 0, 1)
        value = s * s if kind == "cosine-squared" else s * s * (3 - 2 * s)
    return np.where(c > cc, value, 0)


def marched(world, reference, steps):
    """Airlight and surface of each pixel."""
    model, media = reference.model, world.media(reference)
    cosine, ends = reference.direction @ reference.axis, reference.model.ends_of
    distance = world.surfaces(reference)
    airlight, surface = np.zeros((2, len(cosine), 3))
    for n, (d, c, surface_at) in enumerate(zip(reference.direction, cosine, distance)):
        across = 1 / c if ends.planes else 1
        end = {"axis-ends": c * surface_at, "axis-lookup": surface_at / c}.get(
            model.depth, surface_at
        )
        near, end = ends.near * across, min(end, ends.far * across)
        step = c if model.depth == "axis" else 1
        for body in media:
            airlight[n] += _along(world, reference, media, body, d, c, near, end, step, steps)
        later = model.lobe_of.start if model.lobe_of and end > near else near
        whole = [_total(media, reference.origin, d, first, end) for first in (near, later)]
        if model.constant:
            covered = [1 - np.exp(-model.camera_scale * step * depth) for depth in whole]
            airlight[n] += model.constant * np.minimum(covered[0], model.most)
            for each in reference.directional if model.lobe_of else ():
                towards_sun = max(-each.direction @ d, 0) ** model.lobe_of.power
                airlight[n] += each.irradiance * towards_sun * covered[1]
        if np.isfinite(surface_at):
            seen = np.exp(-model.surface_paths[0] * step * whole[0])
            seen = np.maximum(seen, 1 - model.most) if model.constant else seen
            place = reference.origin + surface_at * d
            surface[n] = _reflected(world, reference, media, place) * seen
    return airlight, surface


def _total(media, origin, d, start, end):
    if isinstance(media[0], Even) and np.isinf(end):
        return np.full(3, np.inf)
    total = np.zeros(3)
    for body in media:
        first, last = body.within(origin, d, start, end)
        if last > first:
            total += body.depth((origin + first * d)[None], (origin + last * d)[None])[0]
    return total


def _along(world, reference, media, body, d, c, near, end, step, steps):
    model, origin = reference.model, reference.origin
    first, last = body.within(origin, d, near, end)
    if last <= first:
        return 0
    # Midpoints of even steps of u, with x = scale u/(1 - u), for unbounded rays too.
    scale = world.scale
    begin, stop = first / (scale + first), last / (scale + last) if np.isfinite(last) else 1.0
    u = begin + (stop - begin) * (np.arange(steps) + 0.5) / steps
    x, dx = scale * u / (1 - u), (stop - begin) / steps * scale / (1 - u) ** 2
    p = origin + x[:, None] * d
    sigma = body.sigma(p)
    # A medium by itself begins where the ray enters it.
    start = (origin + (near if isinstance(body, Body) else first) * d)[None]
    depth = sum(each.depth(start, p) for each in media)
    seen = body.albedo * sigma * np.exp(-model.camera_scale * step * depth)
    total = np.zeros_like(seen)
    phase = body.phase if isinstance(body, Body) else PHASES[model.phase]
    if model.constant is None:
        falls = 1 if model.fade_of is None else (model.fade_of[1] - c * x) / np.ptp(model.fade_of)
        for lamp in reference.lights:
            way = p - lamp.position
            r = np.linalg.norm(way, axis=1)
            away = way / r[:, None]
            scatters = phase(-away @ d) if model.phase != "none" else 4 * np.pi
            sent = edge(model, lamp, away) * law(model.law_of(surface=False), r)
            sent = sent * window(model.range_of, r) * scatters * ~world.blocked(p, -away)
            passed = np.exp(-model.light_scale * sum(m.depth(lamp.position, p) for m in media))
            total += model.factors[0] * lamp.intensity * sent[:, None] * passed
        for each in reference.directional:
            sent = phase(np.full(steps, -each.direction @ d)) * ~world.blocked(p, -each.direction)
            passed = 1.0
            if model.light_scale:
                beyond = sum(m.beyond(p, -each.direction) for m in media)
                passed = np.exp(-model.light_scale * beyond)
            total += model.factors[1] * each.irradiance * sent[:, None] * passed
        total *= np.maximum(falls, 0)[:, None] if model.fade_of else 1
        total *= np.exp(-model.light_length * sigma) / (4 * np.pi)
    if model.ambient_of:
        total += np.array(model.ambient_of)
    return (seen * total * dx[:, None]).sum(axis=0) * step


def _reflected(world, reference, media, place):
    """Return what the ground reflects."""
    model, p = reference.model, place[None]
    total = np.zeros(3)
    for lamp in reference.lights:
        way = place - lamp.position
        r = np.linalg.norm(way)
        sent = edge(model, lamp, way[None] / r) * law(model.law_of(surface=True), np.array([r]))
        sent = sent * window(model.range_of, np.array([r])) * -way[2] / r
        depth = sum(m.depth(lamp.position, p) for m in media)[0]
        total += lamp.intensity * sent[0] * np.exp(-model.surface_paths[1] * depth)
    for each in reference.directional:
        beyond = sum(m.beyond(p, -each.direction) for m in media)[0]
        passed = np.exp(-model.surface_paths[1] * beyond) if model.surface_paths[1] else 1
        total += each.irradiance * -each.direction[2] * passed
    reflectance = np.array([0.4, 0.4, 0.5]) if world.ground < 10 else np.full(3, 0.5)
    return reflectance / np.pi * model.factors[2] * total


# Scenes without shadows but that of the ground.

HG = {"type": "hg", "g": G}
FACING = SUN.replace('x="0.5" y="0.3"', 'x="-0.5" y="-0.3"')  # the camera looks towards it
FOG = {
    "type": "homogeneous",
    "id": "fog",
    "sigma_t": 0.31,
    "albedo": {"type": "rgb", "value": [0.9, 0.8, 0.7]},
    "phase": HG,
}
COLOURED = {
    "sigma_t": {"type": "rgb", "value": [0.1, 0.3, 0.7]},
    "has_spectral_extinction": True,
}


def _even(reference):
    return [Even(reference.medium.sigma_t, reference.medium.albedo)]


def _lamps():
    lamps = {"second": spot(beam=11.0)}
    return World(mi.load_dict(tiny_scene(size=_SIZE, ball=None, fog=FOG, **lamps)), _even, 6.3)


def _coloured():
    fog = FOG | COLOURED
    return World(mi.load_dict(tiny_scene(size=_SIZE, ball=None, floor=None, fog=fog)), _even)


def _sun():
    fog = FOG | COLOURED
    scene = tiny_scene(size=_SIZE, ball=None, lamp=None, sun=sun(), fog=fog)
    return World(mi.load_dict(scene), _even, 6.3)


def _bodies():
    hg, albedos = {"phase": {"type": "hg", "g": 0.6}}, ((0.9, 0.4, 0.3), (0.2, 0.5, 0.8))
    # The ground cuts both media.
    at = mi.ScalarTransform4f().translate([0, 0, 0.55]).scale(6.3)
    floor = tiny_scene()["floor"] | {"to_world": at}
    entries = {"brick": brick(**hg), "pearl": pearl(), "floor": floor}
    scene = clear_scene(size=_SIZE, sun=sun(), **entries)
    scene["sensor"] |= {"fov": 25.0}

    def media(reference):
        def phase(g):
            if reference.model.phase == "cornette-shanks":
                return lambda c: _hg(c, g) * 1.5 * (1 + c * c) / (2 + g * g)
            return lambda c: _hg(c, g)

        return [
            Body(box(*BRICK), np.array([0.9, 0.5, 0.2]), np.array(albedos[0]), phase(0.6)),
            Body(ball(*PEARL), np.full(3, 1.3), np.array(albedos[1]), phase(0.0)),
        ]

    return World(mi.load_dict(scene), media, 6.3, height=0.55, steps=512)


def _layers(*lights):
    """Height fog over ground."""
    parts = "".join(lights)
    text = f"""<scene version="3.0.0">
    <medium type="heterogeneous" id="fog">{LAYERS}<rgb name="albedo" value="0.9, 0.85, 0.7"/>
        <phase type="hg"><float name="g" value="{G}"/></phase></medium>
    <sensor type="perspective"><float name="fov" value="50"/><ref id="fog" name="medium"/>
        <transform name="to_world">
            <lookat origin="-13.7, -4.1, 2.3" target="0.3, 0.7, 2.9" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="9"/>
        </film></sensor>
    <shape type="rectangle" id="ground"><transform name="to_world"><scale value="60"/></transform>
    </shape>{parts}</scene>"""
    return text


def _media_of_layers(reference):
    return [Layers(reference.medium.albedo)]


def _make(name, folder):
    made = {"lamps": _lamps, "coloured": _coloured, "sun": _sun, "bodies": _bodies}
    if name in made:
        return made[name]()
    path = folder / f"{name}.xml"
    if name == "grid":
        path.write_text(grid_xml(volume(folder / "x.vol", ROUGH), INSIDE, size=(6, 4), shapes=""))
        how = {"steps": 128, "samples": 256, "most": 0.03}  # ratio tracking is noisy
        return World(load_scene(str(path)).scene, lambda reference: [Grid(reference.medium)], **how)
    path.write_text(_layers(LAMP, SPOT) if name == "layers" else _layers(FACING))
    return World(load_scene(str(path)).scene, _media_of_layers, 60.0, steps=768, scale=16.0)


@pytest.fixture(scope="module")
def world(variant, tmp_path_factory):
    """Scenes by their names, each made once."""
    made, folder = {}, tmp_path_factory.mktemp("worlds")

    def of(name):
        if name not in made:
            made[name] = _make(name, folder)
        return made[name]

    return of


def terms(words):
    """The model of terms, parted by spaces."""
    return Model.of(dict(each.split("=", 1) for each in words.split()))


CASES = {
    "paths": ("lamps", "light-path=0.4 camera-path=0.6 phase=cornette-shanks"),
    "length": ("lamps", "light-path=length:2.5 camera-path=1.7"),
    "nothing attenuates": ("lamps", "light-path=off camera-path=off law=softened:1:16"),
    "no camera path": ("lamps", "camera-path=off law=sphere:0.6"),
    "power": ("lamps", "law=power:1.5 phase=isotropic"),
    "clamped, linear": ("lamps", "law=clamped:0.9:3 range=linear:4"),
    "power, square": ("lamps", "law=power:1 range=square:3 phase=hg:-0.3"),
    "quartic, smooth": ("lamps", "range=quartic:4 spot=cosine-smooth"),
    "fourth, squared": ("lamps", "range=fourth:3.5 spot=cosine-squared"),
    "cut, rim": ("lamps", "range=cut:2.5 spot=rim:2"),
    "axis": ("lamps", "depth=axis camera-path=0.7"),
    "axis-ends": ("lamps", "depth=axis-ends"),
    "axis-lookup": ("lamps", "depth=axis-lookup camera-path=0.8 ambient=0.02"),
    "planes": ("lamps", "ends=planes:1:5 depth=axis"),
    "spheres": ("lamps", "ends=spheres:2:4.5 camera-path=0.5 phase=murky"),
    "fade": ("lamps", "fade=3:6 light-path=off camera-path=off"),
    "surfaces": (
        "lamps",
        "lamps=0.3 surface.light-path=off surface.camera-path=0.5 surface.law=clamped:1.3:1 "
        "surface.factor=2.1 range=quartic:7",
    ),
    "ambient": ("coloured", "ambient=0.3,0.2,0.1 camera-path=0.6 depth=axis"),
    "constant": ("lamps", "source=constant:0.3,0.2,0.1 cap=0.8 camera-path=0.4"),
    "coloured": ("coloured", "camera-path=0.2 light-path=0.1"),
    "playcanvas": (
        "lamps",
        "light-path=off camera-path=0.5 law=softened:1:16 range=quartic:8 ends=spheres:0:12",
    ),
    "sun": ("sun", "light-path=off suns=0.4 phase=none"),
    "sun, length": ("sun", "light-path=length:1.3 camera-path=0.6 depth=axis"),
    "sun, fade": ("sun", "light-path=off camera-path=off fade=2:5 surface.light-path=on"),
    "sun, lobe": ("sun", "light-path=off source=constant:0.3,0.2,0.1 lobe=3:1.4 ends=planes:0.5:9"),
    "layers": ("layers", "light-path=0.3 camera-path=0.6 law=softened:0.7 depth=axis"),
    "layers, no paths": ("layers", "light-path=off camera-path=off range=quartic:9 phase=hazy"),
    "layers, ends": (
        "layers",
        "ends=planes:3:15 depth=axis-lookup spot=cosine-smooth surface.camera-path=0.4",
    ),
    "layers, ambient": (
        "layers",
        "ambient=0.3,0.2,0.1 light-path=length:3 camera-path=0.5 depth=axis-ends fade=2:20",
    ),
    "layers, sun": ("layer-sun", "light-path=0.4 camera-path=0.7 suns=8 fade=2:25"),
    "layers, constant": (
        "layer-sun",
        "source=constant:0.3,0.2,0.1 cap=0.7 lobe=4:6 ends=spheres:7:inf ambient=0.1 camera-path=1.3",
    ),
    "bodies": ("bodies", "light-path=0.4 camera-path=0.6 phase=cornette-shanks"),
    "bodies, no light path": (
        "bodies",
        "light-path=off ends=spheres:3.5:4.2 surface.light-path=0.5 law=clamped:2",
    ),
    "bodies, lookup": (
        "bodies",
        "depth=axis-lookup light-path=length:0.7 camera-path=1.4 ambient=0.1",
    ),
    "bodies, axis": ("bodies", "depth=axis ambient=0.3,0.2,0.1 phase=none lamps=0.1"),
    "bodies, constant": ("bodies", "source=constant:0.3,0.2,0.1 lobe=2:4"),
    "grid": ("grid", "light-path=0.4 camera-path=0.6 law=softened:0.3 range=quartic:5"),
    "grid, no paths": ("grid", "light-path=off camera-path=off lamps=2 phase=rayleigh"),
}


#: Cases that have each term once, in each kind of medium.
FAST = (
    "paths",
    "clamped, linear",
    "quartic, smooth",
    "axis-lookup",
    "surfaces",
    "ambient",
    "playcanvas",
    "sun",
    "sun, lobe",
    "layers, ends",
    "layers, sun",
    "bodies",
    "bodies, no light path",
)


def _image(reference, samples, first=0):
    seeds = range(first, first + _BATCHES)
    return reduce(merged, (single_scatter_batch(reference, seed, samples) for seed in seeds))


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[] if case in FAST else pytest.mark.statistical) for case in CASES],
)
def test_samples_follow_the_equation(world, case):
    """Rationale: the march has no density of samples, no plugin and no walk.

    Setup: 8 batches of 64 distances. Expected: sums over the image within four standard errors and
    what halving the steps of the march changes, at most 1 % of the airlight; pixels within their
    errors at a family level of 1e-4; surfaces, which need no samples, to single precision.
    """
    name, words = CASES[case]
    here = world(name)
    reference = read_reference(here.scene, terms(words))
    airlight, surface = marched(here, reference, here.steps)
    coarse, _ = marched(here, reference, here.steps // 2)
    # Each case has seeds of its own: one unlucky draw is not that of all.
    batches = _image(reference, here.samples, _BATCHES * list(CASES).index(case))
    mean, error, marching = batches.mean[0], batches.standard_error[0], np.abs(airlight - coarse)
    # Pixels, with the rounding of single precision.
    rounding = 1e-5 * (airlight + airlight.mean())
    score = np.abs(mean - airlight) / np.hypot(error, marching + rounding)
    assert score.max() < t.isf(0.5e-4 / airlight.size, _BATCHES - 1)
    # Sums.
    total = airlight.sum(axis=0)
    allowed = 4 * np.sqrt((error**2).sum(axis=0)) + marching.sum(axis=0) + 1e-5 * total
    assert (np.abs(mean.sum(axis=0) - total) < allowed).all()
    assert (allowed < here.most * total).all()
    # Where a range or a cone ends, little light is known to few digits.
    assert batches.mean[1] == pytest.approx(surface, rel=3e-5, abs=1e-5 * surface.max(initial=0))


NO_LIGHT_PATH = "light-path=1e-7 surface.light-path=1e-7", "light-path=off"
FAR_END = "", "ends=spheres:0:1e12"
#: Two models that say nearly the same by other code.
SAME = {
    "fog, an end": ("fog", *FAR_END),
    "fog, light path": ("fog", *NO_LIGHT_PATH),
    "bodies, an end": ("bodies", *FAR_END),
    "bodies, light path": ("bodies", *NO_LIGHT_PATH),
    "bodies, camera path": ("bodies", "camera-path=1e-7", "camera-path=off"),
    "layers, an end": ("layers", *FAR_END),
    "layers, light path": ("layers", *NO_LIGHT_PATH),
}


def _with_shadows(name, path):
    if name == "layers":
        path.write_text(fog_xml(LAMP, SPOT, SUN, size=_SIZE))
        return load_scene(str(path)).scene
    if name == "fog":
        return mi.load_dict(tiny_scene(size=_SIZE, second=spot(beam=11.0)))
    lamp, shapes = tiny_scene()["lamp"], ball_over_floor()
    return mi.load_dict(sunny(size=_SIZE, brick=brick(), pearl=pearl(), lamp=lamp, **shapes))


@pytest.mark.parametrize("case", SAME)
def test_shadows_are_those_of_the_physical_equation(variant, tmp_path, case):
    """Both sides draw nearly the same distances: pixels agree to 1e-4, but where a sample lies on
    the edge of a shadow.
    """
    name, *models = SAME[case]
    scene = _with_shadows(name, tmp_path / "scene.xml")
    first, second = (
        single_scatter_batch(read_reference(scene, terms(words)), 5, 64).mean for words in models
    )
    for one, other in zip(first, second):
        apart = np.abs(one - other) > 1e-4 * (one + one.mean())
        assert apart.mean() < 0.02
        assert one.sum() == pytest.approx(other.sum(), rel=1e-3)


def test_the_physical_model_is_the_physical_equation(variant):
    """The same samples and the same kernels: nothing else is traced."""
    scene = mi.load_dict(tiny_scene(size=_SIZE, second=spot(beam=11.0)))
    plain = single_scatter_batch(read_reference(scene), 3, 16)
    named = single_scatter_batch(read_reference(scene, Model(name="ours")), 3, 16)
    assert np.array_equal(plain.mean, named.mean)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("lit=2", "lit is '2'.*'quadrature'"),
        ("phase=hg-draine:12", "phase is 'hg-draine:12'.*cornette-shanks"),
        ("ambient=1 camera-path=off", "ambient is '1,1,1'.* has no sum"),
        ("camera-path=off light-path=off", "light 'sun' is directional.* has no sum"),
    ],
)
def test_refusals(variant, words, message):
    lights = {"sun": sun()} if "off light" in words else {}
    scene = mi.load_dict(tiny_scene(size=_SIZE, **lights))
    with pytest.raises(InputError, match=message):
        single_scatter_batch(read_reference(scene, terms(words)), 0, 4)


def test_a_constant_source_in_a_grid_is_refused(world):
    reference = read_reference(world("grid").scene, terms("source=constant:1"))
    with pytest.raises(InputError, match=r"source is constant in a density grid.*'quadrature'"):
        single_scatter_batch(reference, 0, 4)
