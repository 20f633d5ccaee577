# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --kernels`: kernels alone on many rays."""


def print_kernels(names: list[str] | None, *, phase: str | None, json: bool, markdown: bool) -> None:
    """Print time and error of kernels."""
    from analytic.phase import phase_from_words
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import counted, progress_bar
    from reports.tables.kernels import kernel_tables
    from reports.tables.terminal import print_json
    from validation.kernels.benchmark import PHASES, bench_kernels
    from validation.metrics.errors import plain

    phases = PHASES if phase is None else ((phase, phase_from_words(phase).g),)
    activate()
    with progress_bar("bench") as progress:
        costs = bench_kernels(names, phases=phases, progress=counted(progress))
    measured = plain(costs)
    if json:
        print_json({"environment": describe_environment(), "kernels": measured})
        return
    if markdown:
        print_heading()
    print_tables(kernel_tables(measured["costs"], measured["levels"]), as_markdown=markdown)
    print("ns/ray: the kernel alone by Dr.Jit's history, median.")
