# SPDX-License-Identifier: BSD-3-Clause
"""Writes into wheels and source distributions of which commit they are;
pyproject.toml says all else.
"""

import runpy
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

PACKAGE = Path(__file__).parent / "src" / "airlight"
BUILD = runpy.run_path(str(PACKAGE / "reference" / "storage" / "build.py"))


def _write(package: Path) -> None:
    path = package / BUILD["COMMIT"]
    path.unlink()  # it may be a link to that of the checkout
    path.write_text(BUILD["commit_line"](PACKAGE) + "\n", encoding="utf-8", newline="\n")


class BuildPackage(build_py):
    """Copies the package, and says of which commit it is; an editable installation asks git."""

    def run(self) -> None:
        """Build, and write the commit."""
        super().run()
        if not self.editable_mode:
            _write(Path(self.build_lib) / "airlight")


class SourceDistribution(sdist):
    """Says of which commit the sources are."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Copy the files, and write the commit."""
        super().make_release_tree(base_dir, files)
        _write(Path(base_dir) / "src" / "airlight")


setup(cmdclass={"build_py": BuildPackage, "sdist": SourceDistribution})
