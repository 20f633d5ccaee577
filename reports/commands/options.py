# SPDX-License-Identifier: BSD-3-Clause
"""Options that several commands have, and lists in options."""

from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.machine.own_process import LIMIT

Scene = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A built-in scene, random:SEED or a Mitsuba XML file.",
        show_default=False,
        autocompletion=completion.scenes,
    ),
]
Scenes = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SCENE",
        help="Built-in scenes, random:SEED and Mitsuba XML files; all built-in ones by default.",
        show_default=False,
        autocompletion=completion.scenes,
    ),
]
#: Of `bench` and `report`; `render` takes one, by the same name.
Methods = Annotated[
    list[str] | None,
    typer.Option(
        "--method",
        metavar="NAME",
        help="A method of `airlight list methods`, your own as MODULE:FUNCTION or FILE.py:FUNCTION, or `all`; may be "
        "given several times; all by default.",
        show_default=False,
        autocompletion=completion.methods,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="A parameter of the method, or of each that --method names; may be given several times.",
        show_default=False,
    ),
]
_KERNEL: Any = typer.Option(
    metavar="NAME",
    help="Airlight kernel of the method, see `airlight list kernels`.",
    show_default=False,
    autocompletion=completion.kernels,
)
Kernel = Annotated[str | None, _KERNEL]
GivenKernels = Annotated[list[str] | None, _KERNEL]  #: all that were given, for `single`, which refuses a second
Size = Annotated[
    str | None,
    typer.Option(metavar="WxH", help="Width and height in pixels; the scene's own by default.", show_default=False),
]
#: Of `sweep`, `reference` and `report`.
ClusterPlace = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="WHERE",
        help="Let workers compute: local[:N] processes, tcp://HOST:PORT of a Dask scheduler, or its scheduler file. A "
        "scheduler authenticates nobody and its workers run what they are sent: only on a network that you trust.",
        show_default=False,
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Start also what will take more than an hour, or more memory than there is.")
]
MethodLimit = Annotated[
    float,
    typer.Option("--method-limit", metavar="SECONDS", help="Your own method is stopped after so long in a scene."),
]
USUAL_LIMIT = LIMIT
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Markdown = Annotated[bool, typer.Option("--markdown", help="Print tables for a README, dated.")]
OutputFile = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")]
Mask = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="EXR file that is 0 in pixels to leave out.", show_default=False),
]
#: Of `fit`, and of `compare` with a scene.
Holds = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="NAME",
        help="What a layer of a scene holds, 'airlight', 'surface' or 'total'; what its name says by default.",
        show_default=False,
        autocompletion=completion.one_of("airlight", "surface", "total"),
    ),
]
PixelKind = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Pixels of a scene's image are values at their 'centre' or means over their 'area'. By default what fits "
        "is used: means take several times as long as values.",
        show_default=False,
        autocompletion=completion.one_of("centre", "area"),
    ),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--change",
        metavar="NAME=VALUE",
        help="A camera, light or medium unlike the scene's, such as medium.sigma_t=0.1; may be given several times.",
        show_default=False,
    ),
]


#: Of commands that take a random scene, for `drawn_from`.
Meshes = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Of random scenes: a folder of .obj and .ply files that take part as casters.",
        show_default=False,
    ),
]
Ranges = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Of random scenes: a TOML table of what is drawn from where to where.",
        show_default=False,
    ),
]


def drawn_from(scenes: list[str], meshes: Path | None, ranges: Path | None) -> list[str]:
    """Return the names of scenes, of random ones with what `--meshes` and `--ranges` gave.

    Raises
    ------
    InputError
        If one of them is given and no scene is a random one.
    """
    if meshes is None and ranges is None:
        return scenes
    from validation.scenes.random.scene import is_random, random_name

    if not any(map(is_random, scenes)):
        random_name(scenes[0] if scenes else "", meshes, ranges)
    return [random_name(scene, meshes, ranges) if is_random(scene) else scene for scene in scenes]


def single(option: str, words: list[str] | None) -> str | None:
    """Return the word of an option that takes one here and several in other commands; None for none.

    Raises
    ------
    InputError
        If there are several.
    """
    if words and len(words) > 1:
        from analytic.errors import InputError

        raise InputError(f"{option}: got {' and '.join(words)}, wanted one of them; bench and report take several")
    return words[0] if words else None


def listed(option: str, text: str) -> list[str]:
    """Return the words of an option that commas part.

    Raises
    ------
    InputError
        If one of them is empty.
    """
    words = [word.strip() for word in text.split(",")]
    if not all(words):
        from analytic.errors import InputError

        raise InputError(f"{option}: got {text!r}, wanted names with commas between them, none of them empty")
    return words
