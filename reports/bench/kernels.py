# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --kernels`: kernels alone on many rays."""


def print_kernels(names: list[str] | None, *, phase: str | None, json: bool, markdown: bool) -> None:
    """Print time and error of kernels, and how fast their series converge."""
    from analytic.phase import phase_from_words
    from realtime.kernels.registry import KERNELS
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import counted, progress_bar
    from reports.tables.kernels import convergence_data, kernel_tables, order_table
    from reports.tables.terminal import print_json
    from validation.configurations.kernel_names import split_name
    from validation.kernels.benchmark import PHASES, bench_kernels
    from validation.kernels.convergence import convergence, declared
    from validation.metrics.errors import plain

    wanted = [split_name(name)[0].name for name in names] if names else list(KERNELS)
    phases = PHASES if phase is None else ((phase, phase_from_words(phase).g),)
    activate()
    with progress_bar("bench") as progress:
        costs = bench_kernels(names, phases=phases, progress=counted(progress))
        rates = [convergence(name) for name in declared() if name in wanted]
    measured, orders = plain(costs), [convergence_data(rate) for rate in rates]
    if json:
        print_json({"environment": describe_environment(), "kernels": measured, "convergence": orders})
        return
    if markdown:
        print_heading()
    print_tables(kernel_tables(measured["costs"], measured["levels"]), as_markdown=markdown)
    print("ns/ray: the kernel alone by Dr.Jit's history, median; ~ is extrapolated from fewer steps.")
    if orders:
        print_tables([order_table(orders)], as_markdown=markdown)
