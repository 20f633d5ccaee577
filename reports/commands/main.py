# SPDX-License-Identifier: BSD-3-Clause
"""The command line.

Each sub-command is a function in a module `reports/commands/*.py` that imports nothing heavy at the top: Mitsuba,
Dr.Jit, NumPy, SciPy and matplotlib are imported inside the function, after the arguments were read. So `--help`
answers at once, and a mistake in the arguments costs no start-up. To add a command, write such a module and add the
function to its panel in `_PANELS`.
"""

import errno
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from reports import __version__
from reports.commands.bench import bench
from reports.commands.cache import cache
from reports.commands.clouds import clouds
from reports.commands.compare import compare
from reports.commands.completion import one_of
from reports.commands.describe import describe
from reports.commands.diff import diff
from reports.commands.doctor import doctor
from reports.commands.figures import figures
from reports.commands.fit import fit
from reports.commands.help import HelpfulCommand, HelpfulGroup
from reports.commands.integrate import integrate
from reports.commands.lists import list_
from reports.commands.maps import maps
from reports.commands.merge import merge
from reports.commands.paper import paper
from reports.commands.reference import reference
from reports.commands.render import render
from reports.commands.report import report
from reports.commands.slab import slab
from reports.commands.stability import stability
from reports.commands.sweep import sweep
from reports.commands.test import run_tests
from reports.commands.view import view
from reports.machine.environment import (
    VARIANT_VARIABLE,
    VARIANTS,
    MissingError,
    check_variant,
    install_line,
    missing_packages,
)
from reports.tables.terminal import colours_wanted

DONE, FAILED, WRONG_INPUT, MISSING = 0, 1, 2, 3

#: The panels of --help, by what one wants to do, and their commands in its order.
_PANELS: dict[str, tuple[Callable[..., None], ...]] = {
    "Start": (doctor, list_, render, view, cache),
    "Measure": (report, diff, bench, sweep, maps, stability),
    "Images": (reference, compare, fit, merge, describe, integrate, slab, clouds),
    "Papers": (paper, figures),
    "Develop": (run_tests,),
}
_NAMES = {list_: "list", run_tests: "test"}  #: where the function cannot have the name
_EPILOG = f"""
**Environment**

`{VARIANT_VARIABLE}` does what `--variant` does.

`AIRLIGHT_CACHE_DIR` is the folder of what is kept between runs, `~/.cache/airlight` by default;
`AIRLIGHT_CACHE_SIZE` is how large it may become, `4GiB` by default. See `airlight cache --help`.

`NO_COLOR` turns off colours and bold letters.

**Exit status** 0 done, 1 a check failed, 2 wrong usage or input, 3 something is missing on this machine.
"""

app = typer.Typer(
    name="airlight",
    cls=HelpfulGroup,
    help="How fast, how accurate and how stable is a real-time method for volumetric light, against a ground truth "
    "that can be trusted?",
    epilog=_EPILOG.strip(),
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # `reports.commands.help` draws
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
)
for _panel, _commands in _PANELS.items():
    for _command in _commands:
        # Typer hands unknown arguments of `test` on to pytest.
        _more = {"allow_extra_args": True, "ignore_unknown_options": True} if _command is run_tests else None
        app.command(_NAMES.get(_command), cls=HelpfulCommand, rich_help_panel=_panel, context_settings=_more)(_command)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"airlight {__version__}")
        raise typer.Exit()


@app.callback()
def _global_options(
    variant: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Where kernels run: cuda_ad_rgb or llvm_ad_rgb; the first that works by default.",
            autocompletion=one_of(*VARIANTS),
        ),
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    if variant is not None:
        check_variant(variant)
        os.environ[VARIANT_VARIABLE] = (
            variant  # for `reports.machine.environment.activate`, here and in child processes
        )


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return the exit status.

    The user's mistakes, missing libraries and unusable files give one line on the error stream; any other exception
    is a fault of the program and keeps its traceback.
    """
    command = typer.main.get_command(app)
    plain: dict[str, Any] = {} if colours_wanted() else {"color": False}
    try:
        os.getcwd()
    except OSError:  # Dr.Jit ends the process over it
        return _fail("the current folder was deleted: change into another folder, then run this again", WRONG_INPUT)
    try:
        status = command.main(list(arguments) or ["--help"], prog_name="airlight", standalone_mode=False, **plain)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of the pipe has left
        return _drop_output(FAILED)
    except MissingError as error:
        return _fail(str(error), MISSING)
    except OSError as error:
        if error.filename is None and error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _drop_output(WRONG_INPUT)
        return _fail(f"{error.filename or 'output'}: {error.strerror}", WRONG_INPUT)
    except (ImportError, NameError):  # a NameError is what `import drjit` raises where libatomic is missing
        packages = missing_packages()
        if not packages:
            raise
        return _fail(f"system libraries are missing, install them with `{install_line(packages)}`", MISSING)
    except _input_errors() as error:
        return _fail(str(error), WRONG_INPUT)
    except Exception as error:  # Typer's class for wrong usage is in a private module
        if not hasattr(error, "format_message"):
            raise
        return _usage(error)
    if not arguments:
        return WRONG_INPUT
    return status if isinstance(status, int) else DONE


def _input_errors() -> tuple[type[Exception], ...]:
    """Return both classes for the user's mistakes, as far as they were imported: `analytic` imports NumPy."""
    modules = (sys.modules.get(name) for name in ("analytic.errors", "realtime.errors"))
    return tuple(module.InputError for module in modules if module is not None)


def _fail(message: str, status: int) -> int:
    print(f"airlight: error: {' '.join(message.split())}", file=sys.stderr)
    return status


def _usage(error) -> int:
    """Report wrong usage: Typer's message, which names the nearest command, and where help is."""
    message = error.format_message().rstrip(".")
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "airlight"
    return _fail(f"{message} (see `{path} --help`)", WRONG_INPUT)


def _drop_output(status: int) -> int:
    """Redirect the output to nowhere, so that Python does not try again at exit what cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status
