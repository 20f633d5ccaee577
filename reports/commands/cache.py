# SPDX-License-Identifier: BSD-3-Clause
"""`airlight cache`: where finished references and results lie, how much room they take, and how to be rid of them."""

import time
from typing import Annotated

import typer


def cache(
    clear: Annotated[
        bool, typer.Option("--clear", help="Remove every file; what is needed is computed again.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
) -> None:
    """Show, or clear, what is kept between runs.

    Finished references and results lie in `~/.cache/airlight` (`$XDG_CACHE_HOME/airlight` where that is set).
    `AIRLIGHT_CACHE_DIR` names another folder, `AIRLIGHT_CACHE_SIZE` another limit than 4 GiB (500MB, 20GiB; 0 keeps
    nothing): above it the files that were used longest ago are removed. Exit status 1 if some could not be removed.
    """
    from analytic.errors import InputError
    from reference.storage.cache import cache_entries, cache_folder, cache_limit, clear_cache
    from reports.tables.table import Column, table
    from reports.tables.terminal import print_json, print_table

    folder, limit = cache_folder(), cache_limit()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"the cache {folder} is not a folder; remove it, or name another by AIRLIGHT_CACHE_DIR")
    removed, freed = clear_cache() if clear else (0, 0)
    entries = cache_entries()
    size = sum(entry.size for entry in entries)
    names = sorted({entry.kind for entry in entries})
    kinds = {name: [entry for entry in entries if entry.kind == name] for name in names}
    if json:
        counted = {
            kind: {"files": len(of_kind), "bytes": sum(entry.size for entry in of_kind)}
            for kind, of_kind in kinds.items()
        }
        known = {"folder": str(folder), "limit": limit, "files": len(entries), "bytes": size, "kinds": counted}
        print_json(known | ({"removed": removed, "freed": freed} if clear else {}))
    else:
        if clear:
            print(f"{folder}: {removed} files removed, {_size(freed)} freed")
        if entries or not clear:
            print(f"{folder}: {len(entries)} files, {_size(size)} of at most {_size(limit)}")
        if entries:
            rows = [
                (
                    kind,
                    len(of_kind),
                    _size(sum(entry.size for entry in of_kind)),
                    time.strftime("%Y-%m-%d %H:%M", time.localtime(max(entry.used for entry in of_kind))),
                )
                for kind, of_kind in kinds.items()
            ]
            columns = [
                Column("kind", "kind", words=True),
                Column("files", "files"),
                Column("size", "size"),
                Column("last_used", "last used"),
            ]
            print_table(table("", columns, rows))
    if clear and entries:
        raise typer.Exit(1)


def _size(size: int) -> str:
    """Return a number of bytes in the unit that leaves the fewest digits."""
    value, units = float(size), ["bytes", "KiB", "MiB", "GiB"]
    while value >= 1024 and len(units) > 1:
        value /= 1024
        units.pop(0)
    return f"{value:.0f} {units[0]}" if value >= 100 or units[0] == "bytes" else f"{value:.3g} {units[0]}"
