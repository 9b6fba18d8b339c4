"""What the terminal says of the search."""

from pathlib import Path

import pytest

from mofit.cli.output import show_identification


@pytest.mark.parametrize(
    ("undiscovered", "complete", "said", "unsaid"),
    [
        (0.009, True, "Expected undiscovered: 0.009.", "budget"),
        (0.14, False, "The budget was spent before", "not known"),
        (None, False, "is not known", "Expected"),
        (None, None, "3 minima (2 by the swarm, 1 by the completion).", "undiscovered"),
    ],
)
def test_it_says_whether_the_search_was_complete(capsys, undiscovered, complete, said, unsaid):
    search = {
        "method": "effa",
        "evaluations": 900,
        "minima": 3,
        "found_by": {"swarm": 2, "completion": 1},
        "expected_undiscovered": undiscovered,
        "complete": complete,
    }
    show_identification(
        {"modes": [], "search": search, "findings": [], "warnings": [], "converged": True, "seconds": {"total": 1.0}},
        Path("run"),
    )
    printed = " ".join(capsys.readouterr().out.split())
    assert said in printed
    assert unsaid not in printed


@pytest.mark.parametrize(("simulations", "more"), [(None, "--evaluations"), ("counted", "--simulations")])
def test_it_names_the_option_that_gives_the_search_more(capsys, simulations, more):
    search = {"method": "surrogate", "evaluations": 50, "minima": 1, "found_by": {}, "expected_undiscovered": 2.0}
    counted = {"count": 90, "limit": 100, "failed": 0, "refused": 0, "emulators": {}} if simulations else None
    summary = {"modes": [], "search": {**search, "complete": False}, "findings": [], "warnings": [], "converged": True}
    show_identification({**summary, "simulations": counted, "seconds": {"total": 1.0}}, Path("run"))
    assert f"{more} gives more" in " ".join(capsys.readouterr().out.split())
