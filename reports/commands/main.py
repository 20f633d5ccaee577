# SPDX-License-Identifier: BSD-3-Clause
"""The command line: each command is the public function of `airlight` of the same name.

Cyclopts reads a function's signature and its docstring, so that the docstring is the help. This
module adds the options of all commands: --json prints the result's data, -o writes it to files. A
command returns a result (`reports.tables.record`), which is printed and decides the exit status. To
add a command, write a public function in `reports/api/`, name it in `src/airlight/__init__.pyi`,
and add it to its panel in `_PANELS`.

Modules of commands import nothing heavy at the top, so that `--help` answers at once.
"""

import errno
import inspect
import os
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import cyclopts
import docstring_parser
from cyclopts import App, Group, Parameter

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reports.api.capture import capture
from airlight.reports.api.challenge import challenge_board, challenge_new, challenge_score
from airlight.reports.api.check import check
from airlight.reports.api.compare import compare
from airlight.reports.api.diff import diff
from airlight.reports.api.explore import describe, view
from airlight.reports.api.export import export
from airlight.reports.api.inputs import Files, output_files
from airlight.reports.api.paper import paper
from airlight.reports.api.reference import reference
from airlight.reports.api.render import render
from airlight.reports.api.report import report
from airlight.reports.api.sweep import sweep
from airlight.reports.commands.list import list as list_
from airlight.reports.commands.test import run_tests
from airlight.reports.machine.doctor import doctor
from airlight.reports.machine.environment import (
    VARIANT_VARIABLE,
    MissingError,
    install_line,
    missing_packages,
)
from airlight.reports.machine.process_start import start_again_with
from airlight.reports.studies.registry import STUDIES, endings_of, find_study
from airlight.reports.studies.registry import study as run_study
from airlight.reports.tables.record import Result, colours_wanted, print_json, terminal_width
from airlight.validation.scenes.names import scene_stem

DONE, FAILED, WRONG_INPUT, MISSING = 0, 1, 2, 3


def completion(shell: Literal["bash", "zsh", "fish"]) -> int:
    """Print what completes commands and options in a shell.

    bash: airlight completion bash > ~/.local/share/bash-completion/completions/airlight

    zsh: airlight completion zsh > _airlight, in a folder of fpath

    fish: airlight completion fish > ~/.config/fish/completions/airlight.fish

    Parameters
    ----------
    shell
        The shell.
    """
    print(make_app(whole=True).generate_completion(shell=shell))
    return DONE


#: The panels of --help, by what one wants to do, and their commands in its order.
_PANELS: Mapping[str, tuple[Callable[..., Any], ...]] = {
    "Start": (doctor, list_, render, view, completion),
    "Measure": (report, diff, sweep, run_study),
    "Images": (reference, compare, check, describe, capture, export),
    "Papers": (paper, challenge_new, challenge_score, challenge_board),
    "Develop": (run_tests,),
}
#: where the function cannot have the name; two words are a command of a group
_NAMES = {
    run_tests: "test",
    run_study: "study",
    challenge_new: "challenge new",
    challenge_score: "challenge score",
    challenge_board: "challenge board",
}
#: The groups of commands, with their help.
_GROUPS = {
    "challenge": "Judge a method in scenes drawn after it is named: one number that a paper can cite."
}
_EPILOGUE = f"""Environment

{VARIANT_VARIABLE}: where kernels run, cuda_ad_rgb or llvm_ad_rgb; the first that works by default.

AIRLIGHT_CACHE_DIR is the folder of what is cached between runs, ~/.cache/airlight by default; \
AIRLIGHT_CACHE_SIZE is how large it may become, 4GiB by default. See airlight doctor.

AIRLIGHT_FORCE=1 starts also what will take more than an hour, or more memory than there is. \
AIRLIGHT_METHOD_LIMIT is how long a user method may take for a scene, 300 [s] by default.

NO_COLOR turns off colours and bold letters.

Exit status: 0 done, 1 a check failed, 2 wrong usage or input, 3 something is missing on this machine.
"""
_SET = Annotated[
    Sequence[str],
    Parameter(
        name="--set",
        help=(
            "NAME=VALUE, a parameter of the method, or kernel=NAME for its kernel; may be given "
            "several times."
        ),
    ),
]
_JSON = Annotated[bool, Parameter(name="--json", help="Print JSON.")]
_OUTPUT = Annotated[
    Files, Parameter(name=("--output", "-o"), help="A file to write; may be given several times.")
]
#: options that are not written as their parameter
_SPELT = {"output": ("--output", "-o"), "settings": "--set"}
#: Options that had another name, by their command: scripts that have it go on working.
_BEFORE = {("compare", "--frames"): "--sequence", ("paper", "--figures"): "--pictures"}
_ENDINGS = {reference: (".exr",)}  #: of what -o writes, where it is not a study
#: Options of `render` that ask for something else than a picture.
_NO_PICTURE = ("output", "plan", "timed", "frames")


def _shown_default(value: Any) -> Any:
    """Return a default as the help shows it, None for an empty one."""
    return (
        None
        if value in (None, False, (), "")
        else ", ".join(value)
        if isinstance(value, tuple)
        else str(value)
    )


def _command(
    function: Callable[..., Any], words: Sequence[str], *, endings: Sequence[str] = ()
) -> Callable[..., int]:
    """Return a function as a command: with options for its output, without arguments
    that only Python can give; `words` are those of the command line.
    """
    # The function decides everything: its parameters are the options, their descriptions the help.
    own = inspect.signature(function).parameters
    scope = inspect.unwrap(function).__globals__
    helps = {
        each.arg_name: _plain(each.description)
        for each in docstring_parser.parse(function.__doc__ or "").params
    }
    # A command with --set takes a kernel by --set kernel=NAME.
    sets = "settings" in own or any(
        each.kind is inspect.Parameter.VAR_KEYWORD for each in own.values()
    )
    positional: list[inspect.Parameter] = []
    named: list[inspect.Parameter] = []
    # Every parameter becomes a positional argument or an option. `progress` is for Python: the
    # command line always shows a bar.
    for at, each in enumerate(own.values()):
        kind: Any = inspect.Parameter.KEYWORD_ONLY
        annotation, default = each.annotation, each.default
        if each.name == "progress" or (each.name == "kernel" and sets):
            continue
        if each.kind is inspect.Parameter.VAR_KEYWORD:
            named.append(inspect.Parameter("settings", kind, annotation=_SET, default=()))
            continue
        # Annotations are evaluated where the function was defined, whose types are the ones of the
        # command line at run time.
        if isinstance(annotation, str):
            annotation = eval(annotation, scope)  # our own source, see `reports.api.inputs`
        # a size
        if (
            isinstance(default, tuple)
            and all(isinstance(side, int) for side in default)
            and default
        ):
            default = "x".join(map(str, default))
        how: dict[str, Any] = {"help": helps.get(each.name, "")}
        # Words such as -k belong to pytest. The first argument stands without an option name, as
        # does every one without a default.
        if each.kind is inspect.Parameter.VAR_POSITIONAL:
            kind, how["allow_leading_hyphen"] = each.kind, True
        elif each.kind is not kind and (at == 0 or default is inspect.Parameter.empty):
            kind = inspect.Parameter.POSITIONAL_ONLY
        elif each.name in _SPELT:
            how["name"] = _SPELT[each.name]
        shown = each.replace(
            kind=kind, annotation=Annotated[annotation, Parameter(**how)], default=default
        )
        (named if kind is inspect.Parameter.KEYWORD_ONLY else positional).append(shown)
    # Commands whose result is a file have -o added here; others declare `output` themselves. A
    # study writes its data by -o and has no --json; nor have commands without a result.
    extra: dict[str, Any] = {"output": _OUTPUT} if endings else {}
    if function not in (view, run_tests, completion) and ".json" not in endings:
        extra["json"] = _JSON
    for name, annotation in extra.items():
        default = () if name == "output" else False
        named.append(
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default
            )
        )

    def command(*arguments: Any, **options: Any) -> int:
        # The files are checked before the function runs for minutes.
        json = options.pop("json", False)
        files = output_files(list(options.pop("output", ())), *endings) if endings else []
        settings = options.pop("settings", ()) if "settings" not in own else ()
        # A function with `**parameters` takes them by name, one with `settings` as words.
        if settings:
            from airlight.validation.study.configuration import parse_settings

            options |= parse_settings(list(settings))
        if "progress" in own:
            options["progress"] = True
        if function is render and not (json or any(map(options.get, _NO_PICTURE))):
            options["output"] = [_usual_picture(str(arguments[0]))]
        result = function(*arguments, **options)
        # A result writes itself; an integer is the exit status of the command.
        for path in files:
            result.save(path)
        if isinstance(result, int):
            return result
        return _printed(result, files, shlex.join(["airlight", *words]) if json else None)

    # Both, as cyclopts takes annotations from the function where they have the name of a parameter.
    command.__signature__ = inspect.Signature([*positional, *named])  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in (*positional, *named)}
    return command


def _usual_picture(scene: str) -> Path:
    """Return the file of a picture that was given no name; one that another program wrote is kept."""
    path = Path(f"{scene_stem(scene)}.png")
    if path.exists() and b"Software\0airlight" not in path.read_bytes()[:200]:
        raise InputError(
            f"output: {path} is there, and airlight did not write it; name a file with -o"
        )
    return path


def _plain(words: str | None) -> str:
    """Return words of a docstring for a terminal: paragraphs as lines, no backticks,
    nothing of what Python can do.
    """
    paragraphs = [" ".join(each.split()) for each in (words or "").split("\n\n")]
    return re.sub(
        r"[;.] [Ff]rom Python [^.]*(\.[^ ][^.]*)*\.", ".", "\n\n".join(paragraphs)
    ).replace("`", "")


def _help(function: Callable[..., Any], *, whole: bool) -> str:
    """Return the help of a function, or its first sentence."""
    # Sections of numpydoc are for Python: the help lists options by itself.
    description = inspect.getdoc(function) or ""
    description = re.split(r"\n\n[A-Z][a-z]+\n---", description)[0]
    return _plain(description if whole else description.split("\n\n")[0])


def _printed(result: Result | None, files: Sequence[Path], json_of: str | None) -> int:
    """Print a result, as JSON where a command is given that asked for it; return the
    exit status.
    """
    # A view has no result.
    if result is None:
        return DONE
    # JSON and tables go to standard output, where a pipe reads them; faults go to the error stream,
    # where they do not mix with the data.
    if json_of is not None:
        written = {"output": str(files[-1])} if files else {}
        print_json(result.enveloped(json_of, **written))
    else:
        width = terminal_width()
        print(result.text(width=width, styled=width is not None and colours_wanted()), end="")
        for path in files:
            print(f"wrote {path}")
    sys.stdout.flush()
    for fault in result.faults:
        print(f"airlight: error: {fault}", file=sys.stderr)
    return result.status


def _version() -> str:
    return f"airlight {build().words}"


def make_app(words: Sequence[str] = (), *, whole: bool = False) -> App:
    """Return the command line; only the command that is asked for is more than its
    name and its first sentence, unless all are wanted.
    """
    how: dict[str, Any] = {
        "help_format": "plaintext",
        "default_parameter": Parameter(negative=(), show_default=_shown_default),
        "version_flags": (),
        "help_epilogue": "",
    }
    summary = "How fast, accurate and robust is a real-time method for volumetric light, against a checked reference?"
    # The epilogue and --version belong to the whole program, so that they are set after the
    # settings that subcommands share.
    app = App(
        name="airlight", help=summary, version=_version, suppress_keyboard_interrupt=False, **how
    )
    app.help_epilogue, app.version_flags = _EPILOGUE, ("--version",)
    app["--help"].group = app["--version"].group = Group("Options", sort_key=99)
    # A command has only its name and first sentence until it is the one that runs: reading all
    # signatures would slow every start.
    groups: dict[str, tuple[App, Group]] = {}
    for number, (title, functions) in enumerate(_PANELS.items()):
        group = Group(title, sort_key=number)
        for at, function in enumerate(functions):
            *above, name = _NAMES.get(function, function.__name__).split()
            asked = whole or [*above, name] == list(words[: len(above) + 1])
            holder, panel = app, group
            # The first command of a group makes it.
            if above:
                if above[0] not in groups:
                    made = App(
                        name=above[0], help=_GROUPS[above[0]], group=group, sort_key=at, **how
                    )
                    groups[above[0]] = made, Group("Actions", sort_key=0)
                    app.command(made)
                holder, panel = groups[above[0]]
            sub = App(name=name, help=_help(function, whole=asked), group=panel, sort_key=at, **how)
            if asked and function is run_study:
                _add_studies(sub, words, whole=whole)
            elif asked:
                sub.default(_command(function, words, endings=_ENDINGS.get(function, ())))
            holder.command(sub)
    return app


def _add_studies(app: App, words: Sequence[str], *, whole: bool) -> None:
    """Add the studies to `airlight study`."""
    group = Group("Studies", sort_key=0)
    how: dict[str, Any] = {"help_format": "plaintext", "version_flags": ()}
    how["default_parameter"] = app.default_parameter
    # A study is a command of its own under `airlight study`.
    for number, name in enumerate(STUDIES):
        function = find_study(name)
        asked = whole or name in words[1:2]
        sub = App(name=name, help=_help(function, whole=asked), group=group, sort_key=number, **how)
        if asked:
            sub.default(_command(function, words, endings=endings_of(name)))
        app.command(sub)


def command_names() -> list[tuple[str, ...]]:
    """Return the words of every command and every study."""
    names = [_NAMES.get(each, each.__name__) for several in _PANELS.values() for each in several]
    several = [tuple(name.split()) for name in names if name != "study"]
    return [*several, *(("study", name) for name in STUDIES)]


def find_command(words: Sequence[str]) -> App:
    """Return the command, or the study, that some words name."""
    # Words lead to the subcommand, and only what they name is made whole.
    app = make_app(words)
    for word in words:
        app = app[word]
    return app


def run(arguments: Sequence[str], *, extras: str | None = None) -> int:
    """Run the command line and return the exit status.

    `extras` has the names of those that the launcher added for this command; None where it
    did not start this process.

    The user's mistakes, missing libraries and unusable files give one line on the error stream; any
    other exception is a fault of the program and keeps its traceback.
    """
    try:
        # The folder is checked before Dr.Jit is imported.
        os.getcwd()
    except OSError:  # Dr.Jit ends the process over it
        return _fail(
            "the current folder was deleted: change into another folder, then run this again",
            WRONG_INPUT,
        )
    try:
        # Cyclopts would take pytest's options for its own: they go behind a `--`.
        words = [_today(arguments[0], _at_home(word)) for word in arguments]
        if words[:1] == ["test"] and "--" not in words:  # pytest has its own options
            ours = [word for word in words[1:] if word in ("--all", "--help", "-h")]
            words = ["test", *ours, "--", *(word for word in words[1:] if word not in ours)]
        app = make_app(words)
        status = app(
            words or ["--help"],
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of the pipe has left
        return _drop_output(FAILED)
    except KeyboardInterrupt:
        return 130
    except MissingError as error:
        # The launcher installs an extra when it is first needed and runs the command again.
        # `extras` has what it added already: a package that is still missing then is reported, not
        # installed for ever.
        if error.extra and extras is not None and error.extra not in extras.split():
            start_again_with(" ".join([*extras.split(), error.extra]))
        return _fail(str(error), MISSING)
    except OSError as error:
        # A file that cannot be opened, or a full disk, is for the user to fix; every other OSError
        # is a fault of the program.
        if error.filename is None and error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _drop_output(WRONG_INPUT)
        return _fail(f"{error.filename or 'output'}: {error.strerror}", WRONG_INPUT)
    # a NameError is what `import drjit` raises where libatomic is missing
    except (ImportError, NameError):
        # Only a missing system library explains the failed import: anything else keeps its
        # traceback.
        packages = missing_packages()
        if not packages:
            raise
        return _fail(
            f"system libraries are missing. To install them: {install_line(packages)}", MISSING
        )
    except cyclopts.CycloptsError as error:
        # A comma where a number needs a point gets a hint of its own.
        path, said = " ".join(["airlight", *(error.command_chain or ())]), str(error).rstrip(".")
        comma = re.search(r'unable to convert "(-?\d+),(\d+)"', said)
        hint = f"; write {comma[1]}.{comma[2]}" if comma else ""
        return _fail(f"{said}{hint} (see `{path} --help`)", WRONG_INPUT)
    except InputError as error:
        return _fail(str(error), WRONG_INPUT)
    # Without words the help was printed, and nothing was done.
    if not arguments:
        return WRONG_INPUT
    return status if isinstance(status, int) else DONE


def _at_home(word: str) -> str:
    """Return a word with the home folder for a ~ at its beginning, also behind
    --option=, where shells leave it.
    """
    # A shell expands ~ only where a word begins with it.
    option, equals, value = word.partition("=")
    if word.startswith("~"):
        return os.path.expanduser(word)
    return f"{option}={os.path.expanduser(value)}" if option.startswith("-") and equals else word


def _today(command: str, word: str) -> str:
    """Return a word with the name that an option of a command has today."""
    option, equals, value = word.partition("=")
    return _BEFORE.get((command, option), option) + equals + value


def _fail(message: str, status: int) -> int:
    print(f"airlight: error: {' '.join(message.split())}", file=sys.stderr)
    return status


def _drop_output(status: int) -> int:
    """Redirect the output to nowhere, so that Python does not try again at
    exit what cannot be written.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status
