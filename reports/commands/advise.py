# SPDX-License-Identifier: BSD-3-Clause
"""`airlight advise SCENE`: which method to take."""

from pathlib import Path
from typing import Annotated

import typer

from reports.commands import completion
from reports.commands.options import Json, Meshes, Ranges, Size, drawn_from


def advise(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENE",
            help="A built-in scene, random:SEED or a Mitsuba XML file.",
            show_default=False,
            autocompletion=completion.scenes,
        ),
    ] = None,
    error: Annotated[
        float, typer.Option(metavar="SHARE", help="Relative RMSE of the airlight that the method shall hold.")
    ] = 1e-3,
    share: Annotated[
        float, typer.Option(metavar="SHARE", help="Of scenes like this in which it shall hold it.")
    ] = 0.99,
    size: Size = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    fit: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="In place of a scene: fit the advice anew to the rows of a sweep; may be given several times.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The fitted advice, read or with --fit written; the package's by default.",
            show_default=False,
        ),
    ] = None,
    cost: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="With --fit: the cost of a frame, frame_ms or frame_cpu_ms, its processor time.",
            autocompletion=completion.one_of("frame_ms", "frame_cpu_ms"),
        ),
    ] = "frame_ms",
    json: Json = False,
) -> None:
    """Name the method to take in a scene, for an error.

    What every method would cost and err by is predicted from what the scene holds. The prediction is fitted to the
    rows of a sweep, and says in how many of the scenes that it had not seen its choice held the error. `--method auto`
    of render and view takes the choice. See docs/advise.md.

    Exit status 1 if no method is predicted to hold the error.
    """
    from analytic.errors import InputError

    if (scene is None) == (fit is None):
        raise InputError("advise: wanted a scene, or --fit with the folder of a sweep, one of them")
    if fit is not None:
        _fit(fit, model, cost, json=json)
        return
    from reports.machine.environment import activate
    from reports.tables.advise import advice_data, advice_lines, candidates_table
    from reports.tables.terminal import print_json, print_table
    from validation.advise.auto import checked_error
    from validation.advise.choose import advise as choice
    from validation.advise.model import PACKAGED, read_model
    from validation.scenes.loading import load_scene, parse_size

    asked = checked_error(error, "--error")
    if not 0.5 <= share < 1:
        raise InputError(f"--share: got {share:g}, wanted a share from 0.5 to below 1, such as 0.99")
    pixels = parse_size(size) if size else None
    known = read_model(model or PACKAGED)
    activate()
    from realtime.scene.read_scene import read_scene

    (name,) = drawn_from([scene or ""], meshes, ranges)
    loaded = load_scene(name, pixels)
    advice = choice(known, read_scene(loaded.scene), asked, share=share)
    data = advice_data(name, advice, known, size)
    if json:
        print_json(data)
    else:
        print_table(candidates_table(data))
        print("\n".join(advice_lines(data)))
    if not advice.holds:
        raise typer.Exit(1)


def _fit(folders: list[Path], model: Path | None, cost: str, *, json: bool) -> None:
    from importlib.util import find_spec

    from analytic.errors import InputError
    from reference.storage.files import ensure_writable
    from reports.machine.environment import MissingError
    from reports.tables.terminal import print_json

    if find_spec("pyarrow") is None:
        raise MissingError("--fit needs the package pyarrow: install it with `pip install 'airlight[sweep]'`")
    from validation.advise.fit import fit_and_judge, judgement_lines
    from validation.advise.model import PACKAGED, write_model
    from validation.advise.rows import COSTS, read_rows

    if cost not in COSTS:
        raise InputError(f"--cost: got {cost!r}, wanted {' or '.join(COSTS)}")
    path = model or PACKAGED
    ensure_writable(path)
    rows, made = read_rows(folders, cost)
    fitted, judgement = fit_and_judge(rows, made | {"cost": cost})
    write_model(fitted, path)
    if json:
        print_json({"model": str(path), "configurations": len(fitted.configurations)} | dict(fitted.about))
        return
    print("\n".join(judgement_lines(judgement)))
    print(f"{path}: {len(fitted.configurations)} configurations")
