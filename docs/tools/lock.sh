#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Writes the locked files from pyproject.toml, with the checksums of what is installed: requirements.lock for the main
# job, requirements-sweep.lock and requirements-test.lock for the commands of these names too. Versions that are locked
# stay where they still fit; `sh docs/tools/lock.sh --upgrade` takes the newest.
set -eu
cd "$(dirname "$0")/../.."
lock() {
    uv pip compile pyproject.toml --group launcher --universal --python-version 3.11.2 --generate-hashes --no-annotate \
        --no-header --quiet "$@"
}
lock --all-extras "$@" --output-file requirements-test.lock
for extra in '' sweep; do
    lock --extra view --extra shaders ${extra:+--extra "$extra"} --constraint requirements-test.lock \
        --output-file "requirements${extra:+-$extra}.lock"
done
