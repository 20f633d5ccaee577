# SPDX-License-Identifier: BSD-3-Clause
"""Scenes and tables with bad numbers, geometry, media and lights, and what becomes of
them under every command.

    python -m tests.helpers.bad_inputs [KIND ...]

prints what is wrong. Each input has a process of its own, which does all that users do with a
scene. A process that ends by a signal, a traceback, and anything that is not finite in a file or in
JSON that was written with status 0 are faults; so is a refusal without a word on what is expected.
"""

import contextlib
import io
import json
import math
import os
import struct
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

FOG = {"sigma_t": "0.2, 0.2, 0.2", "albedo": "0.9, 0.8, 0.7", "g": "0.3", "scale": "1", "phase": ""}
VIEW = {"origin": "0, -5, 1", "target": "0.1, 0.2, 0.9", "fov": "45", "size": "12, 9", "camera": ""}
LAMP = {"position": "0.3, 0.4, 1.1", "intensity": "5, 4, 3", "light": ""}
BALL = {"center": "-0.6, 0.7, 0.5", "radius": "0.5", "to_world": "", "extra": ""}
USUAL = FOG | VIEW | LAMP | BALL

#: Not numbers, or too large, or of the wrong sign.
ODD = ("nan", "inf", "-inf", "1e30", "-1e30", "1e39", "-1", "0", "1e-30")


def scene(**changes: str) -> str:
    """Return a ball in fog as XML, with some of `USUAL` changed."""
    values = USUAL | changes
    x, y, z = (word.strip() for word in values["position"].split(","))
    u, v, w = (word.strip() for word in values["center"].split(","))
    width, height = (word.strip() for word in values["size"].split(","))
    phase = values["phase"] or f'<phase type="hg"><float name="g" value="{values["g"]}"/></phase>'
    light = values["light"] or (
        f'<emitter type="point" id="lamp"><point name="position" x="{x}" y="{y}" z="{z}"/>'
        f'<rgb name="intensity" value="{values["intensity"]}"/></emitter>'
    )
    camera = (
        values["camera"]
        or f'<lookat origin="{values["origin"]}" target="{values["target"]}" up="0, 0, 1"/>'
    )
    place = (
        f'<transform name="to_world">{values["to_world"]}</transform>' if values["to_world"] else ""
    )
    return f"""<scene version="3.0.0">
    <medium type="homogeneous" id="fog"><rgb name="sigma_t" value="{values["sigma_t"]}"/>
        <rgb name="albedo" value="{values["albedo"]}"/><float name="scale" value="{values["scale"]}"/>{phase}</medium>
    <sensor type="perspective"><float name="fov" value="{values["fov"]}"/>
        <transform name="to_world">{camera}</transform><ref name="medium" id="fog"/>
        <film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/>
            <rfilter type="box"/></film></sensor>
    {light}
    <shape type="sphere" id="ball"><point name="center" x="{u}" y="{v}" z="{w}"/>
        <float name="radius" value="{values["radius"]}"/>{place}</shape>
    {values["extra"]}</scene>"""


def cloud(sigma_t: str = "1, 1, 1", shape: str = "", name: str = ' id="cloud"') -> str:
    """Return a shape filled with a medium, in the fog."""
    shape = shape or '<point name="center" x="1" y="0" z="1"/><float name="radius" value="0.4"/>'
    return f"""<shape type="sphere"{name}>{shape}<bsdf type="null"/>
        <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="{sigma_t}"/>
        <rgb name="albedo" value="0.5, 0.5, 0.5"/></medium><ref name="exterior" id="fog"/></shape>"""


def mesh(vertices: str, faces: str, folder: Path) -> str:
    """Write a mesh as binary PLY, which holds any float32 number, and return the shape."""
    corners, sides = ([line.split() for line in text.split("\n")] for text in (vertices, faces))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {len(sides)}\nproperty list uchar int vertex_indices\nend_header\n"
    places = b"".join(struct.pack("<f", float(number)) for corner in corners for number in corner)
    indices = b"".join(struct.pack("<Biii", *(int(corner) for corner in side)) for side in sides)
    path = folder / "mesh.ply"
    path.write_bytes(header.encode() + places + indices)
    return f'<shape type="ply" id="mesh"><string name="filename" value="{path}"/></shape>'


def numbers(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield scenes with an odd number in every place."""
    for place, usual in (
        ("position", "{}, 0.4, 1.1"),
        ("intensity", "{}, 4, 3"),
        ("origin", "{}, -5, 1"),
    ):
        for odd in ODD:
            yield f"{place} {odd}", scene(**{place: usual.format(odd)})
    for place in ("g", "fov", "radius", "scale"):
        for odd in ODD:
            yield f"{place} {odd}", scene(**{place: odd})
    for place in ("sigma_t", "albedo"):
        for odd in ("nan", "inf", "1e30", "-1", "0"):
            yield f"{place} {odd}", scene(**{place: f"{odd}, 0.2, 0.1"})
    for odd in ("nan", "inf", "1e30", "0"):
        yield f"centre {odd}", scene(center=f"{odd}, 0.7, 0.5")
        yield f"scale of the ball {odd}", scene(to_world=f'<scale value="{odd}"/>')
    for g in ("1", "-1", "0.999999", "-0.999999"):
        yield f"g {g}", scene(g=g)


def geometry(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield scenes whose camera or shapes are degenerate."""
    square, two = "0 0 0\n1 0 0\n1 1 0\n0 1 0", "3 0 1 2\n3 0 2 3"
    for number, odd in enumerate(("nan", "inf", "1e30", "-1e30")):
        own = folder / str(number)
        own.mkdir()
        yield f"vertex {odd}", scene(extra=mesh(square.replace("1 1 0", f"{odd} 1 0"), two, own))
    for name, corners, sides in (
        ("face beyond the vertices", square, "3 0 1 7"),
        ("face without area", square, "3 0 1 1\n3 0 1 2"),
        ("all vertices the same", "1 1 1\n1 1 1\n1 1 1", "3 0 1 2"),
        ("vertices on a line", "0 0 0\n1 1 1\n2 2 2", "3 0 1 2"),
        ("tiny triangle", "0 0 0\n1e-20 0 0\n0 1e-20 0", "3 0 1 2"),
    ):
        own = folder / name.replace(" ", "-")
        own.mkdir()
        yield name, scene(extra=mesh(corners, sides, own))
    yield "camera in the ball", scene(center="0, -5, 1")
    yield "camera without a direction", scene(target="0, -5, 1")
    yield "camera along up", scene(target="0, -5, 2")
    yield "camera of no size", scene(camera='<scale value="0"/>')
    yield "camera of NaN", scene(camera=f'<matrix value="{" ".join(["nan"] * 16)}"/>')
    yield "camera far away", scene(origin="0, -1e8, 1", position="0.3, 1e8, 1.1")


def media(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield scenes whose media are odd."""
    yield "vacuum", scene(sigma_t="0, 0, 0")
    yield "black fog", scene(albedo="0, 0, 0")
    yield "thicker than float32", scene(scale="1e8")
    yield "cloud of no size", scene(extra=cloud(shape='<float name="radius" value="0"/>'))
    yield "cloud 1e30", scene(extra=cloud(shape='<float name="radius" value="1e30"/>'))
    yield (
        "cloud about the lamp",
        scene(extra=cloud(shape='<point name="center" x="0.3" y="0.4" z="1.1"/>')),
    )
    yield (
        "cloud about the camera",
        scene(extra=cloud(shape='<point name="center" x="0" y="-5" z="1"/>')),
    )
    for values in ("0, 0, 0", "nan, 1, 1", "-1, 1, 1", "1, inf, 1", "1"):
        phase = f'<phase type="tabphase"><string name="values" value="{values}"/></phase>'
        yield f"phase function {values}", scene(phase=phase)


def lights(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield scenes whose light is in a place where the airlight is infinite, or nearly so."""
    straight = {"origin": "0, -5, 1", "target": "0, 0, 1", "size": "9, 9"}
    at_camera = scene(position="0, -5, 1")
    yield "light at the camera", at_camera
    yield "light a millimetre from the camera", scene(position="0.001, -5, 1")
    yield "light on a ray", scene(position="0, 0, 1", **straight)
    yield "light beside a ray", scene(position="1e-6, 0, 1", **straight)
    yield "light behind the camera, on a ray", scene(position="0, -9, 1", **straight)
    yield "light on a ray behind the ball", scene(position="0, 9, 1", center="0, 0, 1", **straight)
    yield "light in the ball", scene(position="-0.6, 0.7, 0.5")
    yield "no light", scene(light="<!-- -->")
    yield "faintest", scene(intensity="1e-44, 0, 0")
    yield "bright", scene(intensity="1e18, 1e18, 1e18")
    yield (
        "two lights, one at the camera",
        scene(extra='<emitter type="point"><point name="position" x="0" y="-5" z="1"/></emitter>'),
    )
    spot = '<emitter type="spot" id="lamp"><transform name="to_world"><lookat origin="{}" target="{}" up="{}"/>'
    spot += '</transform><rgb name="intensity" value="{}"/><float name="cutoff_angle" value="{}"/></emitter>'
    for name, values in {
        "spot at the camera": ("0, -5, 1", "0, 0, 1", "0, 0, 1", "5, 4, 3", "30"),
        "spot on a ray": ("0, 0, 1", "0, 9, 1", "0, 0, 1", "5, 4, 3", "30"),
        "spot on a ray, looking aside": ("0, 0, 1", "9, 0, 1", "0, 0, 1", "5, 4, 3", "30"),
        "spot of no angle": ("0, 0, 3", "0, 0, 0", "0, 1, 0", "5, 4, 3", "0"),
        "spot nan": ("0, 0, 3", "0, 0, 0", "0, 1, 0", "nan, 4, 3", "30"),
        "spot of angle nan": ("0, 0, 3", "0, 0, 0", "0, 1, 0", "5, 4, 3", "nan"),
    }.items():
        yield name, scene(light=spot.format(*values), **straight)


def area_lights(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield scenes whose light has extent, of a shape, a place or a number for which
    there is no image, or hardly.
    """
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    usual = '<rgb name="radiance" value="5, 4, 3"/>'

    def lamp(
        transform: str,
        *,
        kind: str = "rectangle",
        radiance: str = usual,
        bsdf: str = black,
        extra: str = "",
    ) -> str:
        return (
            f'<shape type="{kind}" id="lamp"><transform '
            f'name="to_world">{transform}</transform>{bsdf}{extra}'
            f'<emitter type="area">{radiance}</emitter></shape>'
        )

    above = '<lookat origin="0.3, 0.4, 2.1" target="0.1, 0.2, 0" up="0, 1, 0"/>'
    for kind in ("rectangle", "disk", "sphere"):
        for size in ("0", "nan", "inf", "1e30", "1e-30"):
            yield (
                f"{kind} of size {size}",
                scene(light=lamp(f'<scale value="{size}"/>{above}', kind=kind)),
            )
        for odd in ("nan", "inf", "1e30", "-1", "0", "1e-44"):
            radiance = f'<rgb name="radiance" value="{odd}, 4, 3"/>'
            yield (
                f"{kind} of radiance {odd}",
                scene(light=lamp(above, kind=kind, radiance=radiance)),
            )
        yield (
            f"{kind} stretched",
            scene(light=lamp(f'<scale x="0.5" y="0.2" z="1"/>{above}', kind=kind)),
        )
        yield f"flat {kind}", scene(light=lamp(f'<scale x="0.5" y="0" z="1"/>{above}', kind=kind))
        shear = '<matrix value="0.5 0.2 0 0.3  0 0.5 0 0.4  0 0 0.5 2.1  0 0 0 1"/>'
        yield f"sheared {kind}", scene(light=lamp(shear, kind=kind))
        at_camera = lamp('<scale value="0.3"/><translate x="0" y="-5" z="1"/>', kind=kind)
        yield f"{kind} about the camera", scene(light=at_camera)
    yield (
        "sphere inside out",
        scene(
            light=lamp(above, kind="sphere", extra='<boolean name="flip_normals" value="true"/>')
        ),
    )
    for kind in ("cube", "cylinder"):
        yield f"light on a {kind}", scene(light=lamp(f'<scale value="0.3"/>{above}', kind=kind))
    light = mesh("0 0 2\n1 0 2\n1 1 2\n0 1 2", "3 0 1 2\n3 0 2 3", folder)
    yield (
        "light on a mesh",
        scene(light=light.replace("</shape>", f'<emitter type="area">{usual}</emitter></shape>')),
    )
    texture = '<texture type="checkerboard" name="radiance"/>'
    yield "light of a texture", scene(light=lamp(f'<scale value="0.3"/>{above}', radiance=texture))


def rows(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield tables for `airlight study integrals` with an odd number in every column."""
    header = "phase,g,t,h,x0,x1,sigma_t"
    usual = {"g": "0.3", "t": "1", "h": "0.5", "x0": "0", "x1": "2", "sigma_t": "0.2"}
    for column in usual:
        for odd in ("nan", "inf", "-1e300", "1e300", "1e-300", "0"):
            changed = usual | {column: odd}
            yield f"{column} {odd}", f"{header}\nhg,{','.join(changed.values())}\n"
    yield "light on the segment", f"{header}\nisotropic,0,1,0,0,2,0.2\n"


KINDS = {
    generate.__name__: generate
    for generate in (numbers, geometry, media, lights, area_lights, rows)
}


def _orders(kind: str, path: Path) -> list[list[str]]:
    """Return what to do with an input."""
    out = path.parent
    if kind == "rows":
        printed = [
            ["study", "integrals", str(path), "--precision", name] for name in ("single", "double")
        ]
        return [*printed, ["study", "integrals", str(path), "-o", str(out / "rows.csv")]]
    sampled = ["--error", "0.3", "--estimator"]
    orders = [
        ["describe", str(path), "--json"],
        ["reference", str(path), "--json", "-o", str(out / "reference.exr")],
        [
            "reference",
            str(path),
            "--json",
            "-o",
            str(out / "sampled.exr"),
            *sampled,
            "single-scatter",
        ],
        [
            "reference",
            str(path),
            "--json",
            "-o",
            str(out / "traced.exr"),
            "--samples",
            "64",
            "--estimator",
            "volpath",
        ],
    ]
    for number, method in enumerate(
        ("ray-march", "ray-march", "unshadowed", "shadow-planes", "light-volumes", "min-max")
    ):
        settings = [] if method in ("unshadowed", "shadow-planes") else ["--set", "map=64"]
        settings += ["--set", "shadow=map"] if number == 1 else []
        file = out / f"frame-{number}.exr"
        orders.append(
            ["render", str(path), "--json", "--method", method, "-o", str(file), *settings]
        )
    orders.append(["compare", str(out / "reference.exr"), str(out / "frame-0.exr"), "--json"])
    if kind == "area_lights" and 'type="rectangle"' not in path.read_text():
        return orders  # half a minute each; a report asks no shape of a light
    asked = ["--quick", str(path), "--method", "unshadowed", "--method", "ray-march", "--json"]
    return [*orders, ["report", *asked, "-o", str(out / "study")]]


def _finite_file(path: Path) -> bool:
    """Return whether a file, or all images of a report, hold nothing that is not finite; a
    distance may be infinite.
    """
    import numpy as np

    from airlight.reference.storage.exr import read_exr

    if path.suffix == ".csv":
        header, *lines = (line.split(",") for line in path.read_text().split("\n") if line)
        return all(math.isfinite(float(line[header.index("result")])) for line in lines)
    images = [read_exr(file) for file in ([path] if path.is_file() else path.rglob("*.exr"))]
    return all(np.isfinite(layer).all() for image in images for layer in image.layers.values())


def _fault(order: list[str]) -> str:
    """Run a command in this process; return what is wrong with it, if anything."""
    from airlight.reports.commands.main import run

    output, errors = io.StringIO(), io.StringIO()
    written = Path(order[order.index("-o") + 1]) if "-o" in order else None
    with (
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
        warnings.catch_warnings(record=True) as told,
    ):
        warnings.simplefilter("always")
        try:
            status = run(order)
        except BaseException:  # a traceback, whatever it is of
            return traceback.format_exc()
    said = errors.getvalue()
    if told:
        return f"warning: {told[0].message}"
    if status == 0:
        if "--json" in order:
            try:
                json.loads(output.getvalue(), parse_constant=lambda word: 1 / 0)
            except ZeroDivisionError:
                return "JSON is not finite"
        if written is not None and not _finite_file(written):
            return f"{written.name} is not finite"
    elif status == 2 and not any(
        word in said
        for word in (
            "expected",
            "needs",
            "move",
            "give",
            "use ",
            "reference ",
            "cannot",
            "finite",
            "repair",
        )
    ):
        return f"says nothing of what is expected: {said}"
    elif status not in (1, 2):
        return f"status {status}: {said}"
    return ""


def _child(kind: str, path: Path, report: Path) -> None:
    from airlight.reports.machine.environment import activate
    from airlight.validation.study import study as studies

    os.environ["AIRLIGHT_CACHE_DIR"] = str(path.parent / "cache")
    activate()
    # The scene's own size, in a second: what a report says of a scene, not how well.
    quick = studies.standard_study("quick")
    checks = replace(quick.checks, size=(12, 9), patience=0.1, batches=16)
    small = replace(quick.at((12, 9)), checks=checks, measure=replace(quick.measure, seconds=0.001))
    studies.standard_study = lambda name: small
    for order in _orders(kind, path):
        if order[0] == "compare" and not all(Path(image).is_file() for image in order[1:3]):
            continue
        if fault := _fault(order):
            with report.open("a") as file:  # what was found before a crash is kept
                file.write(f"{' '.join(order)}: {' '.join(fault.split())}\n")


def faults(kind: str) -> Iterator[str]:
    """Yield what is wrong with the commands on each input of a kind, and processes that
    ended otherwise than by 0.
    """
    with tempfile.TemporaryDirectory() as place:
        for number, (name, text) in enumerate(KINDS[kind](Path(place))):
            folder = Path(place) / f"input-{number}"
            folder.mkdir()
            path, report = (
                folder / ("rows.in.csv" if kind == "rows" else "input.xml"),
                folder / "report",
            )
            path.write_text(text)
            sys.stdout.flush()
            # Nothing of Dr.Jit runs yet in this process: its threads would not be in the child.
            process = os.fork()
            if process == 0:
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
                with contextlib.suppress(BaseException):
                    _child(kind, path, report)
                    os._exit(0)
                os._exit(70)
            ended = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
            if report.is_file():
                yield from (f"{name}: {line}" for line in report.read_text().splitlines())
            if ended:
                yield f"{name}: ended by {ended}"


if __name__ == "__main__":
    import mitsuba  # noqa: F401 - once, before the children
    import scipy.stats  # noqa: F401

    found = [fault for kind in sys.argv[1:] or KINDS for fault in faults(kind)]
    print(*found, sep="\n")
    sys.exit(bool(found))
