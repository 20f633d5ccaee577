# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `quadrature`, `single-scatter` and `volpath` share no derivation, so that their agreement is evidence.

The imports of each are followed to their end. What two of them reach is listed here with the reason why it is no
derivation of the airlight; whoever makes them share more must say so in this list.
"""

import ast
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("analytic", "reference", "realtime", "validation", "reports")
ESTIMATORS = {
    "quadrature": "reference.quadrature",
    "single-scatter": "reference.monte_carlo.single_scatter",
    "volpath": "reference.monte_carlo.volpath",
}
READING = {
    "analytic.errors": "words for the user",
    "analytic.phase": "the scene's record names the phase function; the two Monte Carlo estimators ask Mitsuba's",
    "reference.scene.camera": "the rays through the pixel centres: where one looks, no light",
    "reference.scene.convex_bounds": "which shapes may bound a medium; where rays cross them is in `visibility`",
    "reference.scene.directional_light": "direction and irradiance as Mitsuba gives them",
    "reference.scene.read": "coefficients, lights and shapes as Mitsuba gives them",
}
MONTE_CARLO = {"reference.monte_carlo.batches": "means and standard errors over batches"}
#: All that the two Monte Carlo estimators themselves ask of what they share with the quadrature.
ASKED = {"InputError", "TruthScene", "TruthMedium"}


def modules() -> dict[str, Path]:
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


def imported_names(source: str) -> Iterator[tuple[str, str]]:
    """Return modules and names that a source imports anywhere; the name is empty where a whole module is."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)


def direct_imports(sources: dict[str, str], module: str) -> set[str]:
    """Return which of the modules in `sources` one of them imports; a page of a folder counts where it holds code."""
    imported = set()
    for name, word in imported_names(sources[module]):
        imported |= {candidate for candidate in (name, f"{name}.{word}") if candidate in sources}
    return imported


def reached(sources: dict[str, str], folder: str) -> set[str]:
    """Return all modules to which the imports of a folder lead, its own included."""
    waiting = [name for name in sources if name == folder or name.startswith(f"{folder}.")]
    assert waiting, folder
    known: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module not in known:
            known.add(module)
            waiting += direct_imports(sources, module)
    return known


@pytest.fixture(scope="module")
def sources():
    texts = {name: path.read_text() for name, path in modules().items()}
    # the page of a folder holds words alone
    return {name: text for name, text in texts.items() if set(imported_names(text)) or len(ast.parse(text).body) > 1}


@pytest.mark.claim("no-shared-derivation")
@pytest.mark.parametrize("pair", list(combinations(ESTIMATORS, 2)), ids=" and ".join)
def test_two_estimators_share_nothing_but_what_is_listed(sources, pair):
    first, second = (reached(sources, ESTIMATORS[name]) for name in pair)
    allowed = READING if "quadrature" in pair else READING | MONTE_CARLO
    assert first & second <= set(allowed)
    for name, other in (pair, pair[::-1]):
        assert not {module for module in reached(sources, ESTIMATORS[name]) if module.startswith(ESTIMATORS[other])}


def test_the_list_holds_nothing_that_is_not_shared(sources):
    reaching = [reached(sources, folder) for folder in ESTIMATORS.values()]
    shared = [first & second for first, second in combinations(reaching, 2)]
    assert set().union(*shared) == set(READING | MONTE_CARLO)


@pytest.mark.parametrize("name", ["single-scatter", "volpath"])
def test_monte_carlo_asks_the_shared_modules_for_records_alone(sources, name):
    folder = ESTIMATORS[name]
    own = [module for module in sources if module.startswith(folder)]
    asked = {word for module in own for used, word in imported_names(sources[module]) if used in READING}
    assert asked <= ASKED


def test_imports_are_followed_to_their_end():
    sources = {
        "a.one": "def ask():\n    from b import middle\n",
        "b.middle": "import c.deep\n",
        "c.deep": "",
        "d.other": "from c.deep import value\n",
    }
    assert reached(sources, "a") == {"a.one", "b.middle", "c.deep"}
    assert reached(sources, "a") & reached(sources, "d") == {"c.deep"}
