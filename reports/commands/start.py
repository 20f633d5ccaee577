# SPDX-License-Identifier: BSD-3-Clause
"""The start of the `airlight` command: signals before all else.

Signals wait while nobody can handle them: here until the handler stands, and with the launcher also while Python itself
starts. The first milliseconds, of a shell or of Python, are not ours: there the process dies by the signal, and a
console script that is interrupted while Python starts leaves its traceback.
"""


def main() -> None:
    """Run the command line, and end the process with its status."""
    import signal

    stops = {signal.SIGINT, signal.SIGTERM}
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, stops)
    import sys

    from reference.storage.stopping import end_unstopped, stop_on_signals
    from reports.machine.streams import usable_streams

    usable_streams()
    stop_on_signals()
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, stops)
    if sys.flags.no_site:  # as the launcher starts it
        import site

        site.main()
    from reports.commands.main import run

    status = run(sys.argv[1:])
    end_unstopped()
    sys.exit(status)
