# SPDX-License-Identifier: BSD-3-Clause
"""`airlight mutations`: would the checks of the truth find a fault of the physics?"""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from validation.mutations.study import MutationStudy


def mutations(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help="All by default.", show_default=False)
    ] = None,
    margin: Annotated[
        float,
        typer.Option(
            min=1e-4,
            max=0.1,
            metavar="SHARE",
            help="Relative bias that counts as agreement with volpath; with single-scatter, a twentieth.",
        ),
    ] = 0.01,
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the images in pixels.")] = "48x36",
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Count how many faults of the physics the checks find.

    The faults are put into copies of the estimators, which the standard run then checks. Exit status 1 if fewer
    than nine in ten are caught, or if the unchanged copy does not agree.
    """
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json
    from validation.mutations.catalogue import chosen_mutations
    from validation.mutations.study import study_mutations
    from validation.scenes.loading import parse_size

    chosen, pixels = chosen_mutations(names), parse_size(size)
    activate()
    with progress_bar("mutations") as progress:
        study = study_mutations(chosen, size=pixels, margin=margin, progress=progress)
    if json:
        from validation.metrics.errors import plain

        data = {
            "environment": describe_environment(),
            "caught": study.caught,
            "mutations": len(study.results),
            "passed": study.passed,
            "control": study.control,
            "results": study.results,
        }
        print_json(plain(data))
    else:
        _print_results(study)
    if not study.passed:
        raise typer.Exit(1)


def _print_results(study: "MutationStudy") -> None:
    from reports.machine.printing import print_tables
    from reports.tables.checks import control_table, mutation_table
    from validation.metrics.errors import plain

    faults = mutation_table(plain(study.results))
    shown = faults.only("name", "caught", "chance", "by", "true_bias", "bias", "interval", "margin", "meaning")
    print_tables([replace(shown, title=""), control_table(plain(study.control))])
    for result in study.results:
        if result.reason:
            seen = "seen by a probe alone" if result.caught else "NOT CAUGHT"
            print(f"{result.name}: {seen}: {result.reason}")
    print(f"{study.caught} of {len(study.results)} mutations caught")
