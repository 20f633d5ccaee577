# SPDX-License-Identifier: BSD-3-Clause
"""`airlight mutations`: would the checks of the truth find a fault of the physics?"""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from validation.mutations.study import MutationResult, Sighting


def mutations(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="All by default.")] = None,
    margin: Annotated[
        float,
        typer.Option(
            min=1e-4,
            max=0.1,
            help="Relative bias that counts as agreement with volpath; with single-scatter, a twentieth.",
        ),
    ] = 0.01,
    size: Annotated[str, typer.Option(help="Size of the images, WIDTHxHEIGHT.")] = "48x36",
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Put faults of the physics into copies of the estimators and count how many the standard run catches.

    Exit status 1 if fewer than nine in ten are caught, or if the unchanged copy does not agree either.
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
        found = study_mutations(chosen, size=pixels, margin=margin, progress=progress)
    if json:
        from reports.data.serialize import plain

        data = {
            "environment": describe_environment(),
            "caught": found.caught,
            "mutations": len(found.results),
            "passed": found.passed,
            "control": found.control,
            "results": found.results,
        }
        print_json(plain(data))
    else:
        _print_results(found)
    if not found.passed:
        raise typer.Exit(1)


def _print_results(found) -> None:
    from reports.tables.terminal import print_table

    headers = (
        "mutation",
        "caught",
        "chance",
        "by",
        "true bias",
        "bias seen",
        "95 % interval",
        "margin",
        "what it stands for",
    )
    print_table(headers, [_row(result) for result in found.results])
    controls = [
        (
            f"{one.scene}, {one.layer}, {one.against}",
            *_numbers(one)[1:],
            f"{100 * one.chance:.2g} %",
            "yes" if one.agrees else "NO",
        )
        for one in found.control
    ]
    control_headers = ("control", "bias seen", "95 % interval", "margin", "false alarms", "agrees")
    print_table(control_headers, controls, "without a mutation")
    for result in found.results:
        if result.reason:
            seen = "seen by a probe alone" if result.caught else "NOT CAUGHT"
            print(f"{result.name}: {seen}: {result.reason}")
    print(f"{found.caught} of {len(found.results)} mutations caught")


def _row(result: "MutationResult") -> tuple[str, ...]:
    one = result.clearest
    by = f"{one.scene}, {one.layer}, {one.against}"
    caught, chance = ("yes" if result.caught else "NO"), f"{100 * result.chance:.0f} %"
    return (result.name, caught, chance, by if result.caught else "", *_numbers(one), result.meaning)


def _numbers(one: "Sighting") -> tuple[str, str, str, str]:
    low, high = one.interval
    return (
        f"{100 * one.true_bias:+.3g} %",
        f"{100 * one.relative_bias:+.3g} %",
        f"{100 * low:+.3g} to {100 * high:+.3g} %",
        f"±{100 * one.margin:g} %",
    )
