# SPDX-License-Identifier: BSD-3-Clause
import json
from dataclasses import replace

import pytest

from reports.commands.main import run
from validation.mutations.catalogue import MUTATIONS
from validation.mutations.study import MutationStudy, Sighting, judged

WRONG = Sighting(
    scene="open-fog",
    built_in=True,
    layer="airlight",
    against="volpath",
    margin=0.005,
    true_bias=0.309,
    relative_bias=0.31,
    interval=(0.30, 0.32),
    detectable_bias=0.003,
    chance=1.0,
    nonfinite=0,
    rejected=7,
    expected_rejections=0.01,
    agrees=False,
)
RIGHT = replace(WRONG, true_bias=0.001, relative_bias=0.0003, interval=(-0.0015, 0.0021), chance=0.25, agrees=True)


@pytest.fixture
def study(monkeypatch, variant):
    """Let the command find what a test wants it to find; returns the arguments that it asked with."""
    asked = {}

    def replace_by(*seen):
        def judge_all(mutations, **arguments):
            asked.update(arguments, mutations=[mutation.name for mutation in mutations])
            results = tuple(judged(mutation, [outcome]) for mutation, outcome in zip(mutations, seen, strict=True))
            return MutationStudy((RIGHT,), results)

        monkeypatch.setattr("validation.mutations.study.study_mutations", judge_all)
        return asked

    return replace_by


def test_the_table_names_every_mutation_and_says_why_one_was_missed(study, capsys):
    names = [mutation.name for mutation in MUTATIONS[:10]]
    asked = study(*(WRONG,) * 9, RIGHT)
    assert run(["mutations", *names, "--size", "24x18", "--margin", "0.01"]) == 0
    assert (asked["mutations"], asked["size"], asked["margin"]) == (names, (24, 18), 0.01)
    printed = capsys.readouterr().out
    assert all(name in printed for name in names)
    assert "open-fog, airlight, volpath" in printed
    assert f"{names[9]}: NOT CAUGHT: the fault changes open-fog, airlight, by +0.1 %" in printed
    assert "25 %" in printed
    assert "9 of 10 mutations caught" in printed


def test_too_few_caught_is_a_failure(study, capsys):
    study(WRONG, RIGHT)
    assert run(["mutations", "no-four-pi", "near-clip", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert (data["caught"], data["mutations"], data["passed"]) == (1, 2, False)
    assert [result["caught"] for result in data["results"]] == [True, False]
    assert data["results"][0]["clearest"]["interval"] == [0.30, 0.32]
    assert data["control"][0]["agrees"] is True


def test_an_unknown_name_is_wrong_input(capsys):
    assert run(["mutations", "near-clop"]) == 2
    assert "did you mean 'near-clip'" in capsys.readouterr().err
