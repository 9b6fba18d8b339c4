"""The benchmarks of the search: functions with known optima, peers held to their budget."""

import numpy as np
import pytest

from benchmarks import cec2013, peers, rastrigin, run_benchmark
from benchmarks.cec2013 import FUNCTIONS, found_optima
from benchmarks.rastrigin import Rastrigin, found
from benchmarks.rows import Absent, KeptRows, row
from mofit.errors import InputError

VINCENT = np.exp((np.pi / 2 + 2 * np.pi * np.arange(-2, 4)) / 10)

OPTIMA = {
    1: [[0.0], [30.0]],
    2: [[0.1], [0.3], [0.5], [0.7], [0.9]],
    4: [[3.0, 2.0], [-2.805118, 3.131312], [-3.779310, -3.283186], [3.584428, -1.848126]],
    5: [[0.08984201, -0.71265640], [-0.08984201, 0.71265640]],
    7: np.array(np.meshgrid(VINCENT, VINCENT)).reshape(2, -1).T,
    9: np.array(np.meshgrid(VINCENT, VINCENT, VINCENT)).reshape(3, -1).T,
    10: np.array(np.meshgrid((2 * np.arange(3) + 1) / 6, (2 * np.arange(4) + 1) / 8)).reshape(2, -1).T,
}


def unit(function, points):
    lower, upper = np.array(function.lower), np.array(function.upper)
    return (np.asarray(points, dtype=float) - lower) / (upper - lower)


@pytest.mark.parametrize("number", sorted(OPTIMA))
def test_published_optima_are_all_counted(number):
    function = FUNCTIONS[number - 1]
    points = unit(function, OPTIMA[number])
    assert len(points) == function.optima
    assert found_optima(function, np.vstack([points, points[:1]]), 1e-5) == function.optima
    assert found_optima(function, points + 0.05, 1e-5) < function.optima


@pytest.mark.parametrize(("number", "point"), [(6, (-7.08350641, 4.85805688)), (3, (0.07969956,))])
def test_value_of_a_published_optimum(number, point):
    function = FUNCTIONS[number - 1]
    value = -function.value(unit(function, [point]))[0, 0]
    assert value == pytest.approx(function.best, rel=1e-6)


@pytest.mark.parametrize("function", FUNCTIONS[1:10], ids=lambda f: f.name)  # compositions have fractal parts
def test_gradients_of_the_benchmark(function, rng):
    u = rng.uniform(0.1, 0.9, (5, function.dimension))
    value, slope = function.gradient(u)
    step = 1e-6
    for k in range(function.dimension):
        move = step * np.eye(function.dimension)[k]
        central = (function.value(u + move) - function.value(u - move)) / (2 * step)
        np.testing.assert_allclose(slope[:, 0, k], central[:, 0], rtol=1e-4, atol=1e-4 * np.abs(value).max())


def test_rastrigin_minima_inside_a_turned_box(rng):
    function = Rastrigin.turned(rng)
    z = function.minima
    _, slope = function.gradient((z + 2) / 4)
    assert np.all(np.abs(slope) < 1e-3)
    assert found(z, z, 0.05) == len(z)
    assert found(z[1:], z[:1], 0.05) == 0


PEERS = ("multi_start", "mlsl", "shgo", "basin_hopping", "differential_evolution", "niche_ga", "omni")


@pytest.mark.filterwarnings("ignore")  # theirs
@pytest.mark.parametrize("name", PEERS)
def test_peers_keep_to_their_budget(name):
    function = Rastrigin.plain()
    try:
        answer = getattr(peers, name)(function, 2, 600, np.random.default_rng(1), 3)
    except Absent as reason:
        pytest.skip(str(reason))
    assert 0 < answer.spent <= 600
    assert np.all((answer.points >= 0) & (answer.points <= 1))
    assert found(function.scaled(answer.points), function.minima, 0.3) >= 1


def test_rows_do_not_depend_on_jobs(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    entries = [entry for entry in rastrigin.ENTRIES if entry.name == "mlsl"]
    rows, settings = rastrigin.run(runs=2, seed=4, entries=entries)
    again, _ = rastrigin.run(runs=2, seed=4, jobs=2, entries=entries)
    assert rows == again
    assert settings["seed"] == 4
    mlsl = next(row for row in rows if row["search"] == "mlsl")
    assert mlsl["found"] >= 24


def test_options_that_a_benchmark_does_not_take():
    with pytest.raises(InputError, match="--runs"):
        run_benchmark("kernel", runs=3)


@pytest.mark.parametrize(("option", "value"), [("runs", 0), ("runs", -3), ("jobs", 0), ("seed", -1)])
def test_values_that_a_benchmark_does_not_take(option, value):
    with pytest.raises(InputError, match=f"--{option}: {value} cannot be used"):
        run_benchmark("rastrigin", **{option: value})


def test_an_absent_competitor_has_a_row_with_the_reason():
    def absent():
        raise Absent("not here")

    assert row({"name": "other"}, absent) == {"name": "other", "skipped": "not here"}


def test_kept_rows_are_taken_and_a_torn_one_is_made_anew(tmp_path):
    first = KeptRows("study", {"seed": 1}, tmp_path)
    first.add({"a": 1}, lambda: {"b": 0.5})
    first.add({"a": 2}, lambda: {"b": 0.25})
    first.path.write_text(first.path.read_text()[:-5])
    again = KeptRows("study", {"seed": 1}, tmp_path)
    again.add({"a": 1}, lambda: pytest.fail("it was there"))
    again.add({"a": 2}, lambda: {"b": 0.75})
    assert [row["b"] for row in again.done()] == [0.5, 0.75]
    assert not first.path.exists()
    assert KeptRows("study", {"seed": 2}, tmp_path).path != first.path


COMPOSITIONS = [function for function in FUNCTIONS if function.number > 10]


@pytest.mark.parametrize("function", COMPOSITIONS, ids=lambda f: f"{f.number}")
def test_compositions_have_the_official_values(function, rng):
    iohcpp = pytest.importorskip("ioh.iohcpp", reason="ioh is not installed (extra 'bench')")
    official = iohcpp.problem.CEC2013.create(1100 + function.number, 1, function.dimension)
    optima = unit(function, [optimum.x for optimum in official.optima])
    assert function.value(optima)[:, 0] == pytest.approx(np.zeros(function.optima), abs=1e-6)
    near = np.clip(optima + 0.01 * rng.standard_normal(optima.shape), 0, 1)
    for u in (rng.random((20, function.dimension)), near):
        expected = [official(x) for x in function.scaled(u)]
        assert -function.value(u)[:, 0] == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_an_interrupted_study_of_cec_2013_resumes_run_by_run(tmp_path):
    kept = tmp_path / "runs.jsonl"
    few = {"functions": FUNCTIONS[3:5], "entries": cec2013.ENTRIES[:1], "kept": kept}
    rows, settings = cec2013.run(runs=2, seed=3, **few)
    lines = kept.read_text().splitlines(keepends=True)
    assert len(lines) == 4
    kept.write_text("".join(lines[:2]) + lines[2][:30])
    again, _ = cec2013.run(runs=2, seed=3, jobs=2, **few)
    assert kept.read_text().startswith("".join(lines[:2]))
    for first, same in zip(rows, again, strict=True):
        assert {**first, "seconds": 0} == {**same, "seconds": 0}
    own, best = rows[0], rows[1]
    assert (own["search"], own["PR 0.0001"], own["functions"]) == ("effa", 1.0, 2)
    assert best["mean PR"] == 0.906
    assert [row["runs"] for row in rows[3:]] == [2, 2]
    assert settings["seed"] == 3
