"""What is told before the numbers: misfits, limits, parameters that act only together; and ranges that widen."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import damper_campaign
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.combinations import TOGETHER, combined
from mofit.identification.findings import at_limits, misfit
from mofit.identification.identify import identify
from mofit.identification.result import PosteriorMode
from mofit.identification.settings import Settings
from mofit.identification.stages import locate_minima
from mofit.identification.valleys import without_joined
from mofit.identification.widening import widenings
from mofit.models import Channel, Equations, Model, find_model
from mofit.optimize import merge, refine
from mofit.parameters import Parameter, ParameterSpace
from mofit.results import summary
from mofit.sampling import Chains, SampleSettings, sample_mode

SINES = damper_campaign()


class NarrowRig(Model):
    """The damper of the rig, searched where its stiffness and its damping are not."""

    name = "narrow_rig"
    parameters = (
        Parameter("c", "N/m", 0.0, 300.0, 100.0),
        Parameter("d", "N s/m", 1.0, 50.0, 10.0, "log"),
        Parameter("F_0", "N", -50.0, 50.0, 0.0),
    )
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": s.c * s.displacement + s.d * s.velocity + s.F_0})


def best_of(located):
    space = located.posterior.space
    return dict(zip(space.names, space.from_unit(located.minima[0].point), strict=True))


def findings(located, asked=()):
    problem, best = located.problem, located.minima[0]
    nrmsd = problem.objectives(best.point[None])[0]
    return [*misfit(problem, nrmsd), *at_limits(problem.space, best, best.hessian, asked)]


def test_a_range_without_the_best_fit_is_widened_and_told():
    located = locate_minima(SINES, NarrowRig(), Settings(jobs=1))
    assert best_of(located)["c"] == pytest.approx(2000, rel=0.02)
    assert best_of(located)["d"] == pytest.approx(1500, rel=0.01)
    assert [note.split()[3] for note in located.warnings] == ["c", "d"]
    assert located.findings == ()
    assert findings(located) == []


def test_where_time_is_up_a_range_is_not_widened_and_that_is_found():
    located = locate_minima(SINES, NarrowRig(), Settings(jobs=1), until=0.0)
    assert located.warnings == ()
    assert [finding.kind for finding in located.findings] == ["time limit"]
    assert best_of(located)["c"] <= 300


def test_bounds_of_the_user_are_kept_and_told_with_what_they_decide():
    located = locate_minima(SINES, find_model("kelvin_voigt_damper"), Settings(jobs=1, bounds={"d": (1.0, 900.0)}))
    assert best_of(located)["d"] == pytest.approx(900)
    kinds = {finding.kind: finding for finding in findings(located, ("d",))}
    assert kinds["misfit"].level == "caution"
    assert "d is at the limit asked for, 900 N s/m" in kinds["limit"].text


def test_a_parameter_that_is_zero_is_no_finding():
    located = locate_minima(SINES, find_model("maxwell_damper"), Settings(jobs=1, bounds={"c_M": (1e2, 1e5)}))
    assert [finding.kind for finding in findings(located)] == []


def test_a_model_that_lacks_the_branch_does_not_fit():
    rough = damper_campaign((("cubic_stiffness", {"k_c": "5e7 N/m^3"}),))
    located = locate_minima(rough, find_model("kelvin_voigt_damper"), Settings(jobs=1, fixed={"p": 0.0}))
    (found,) = findings(located)
    assert found.kind == "misfit"
    assert "times the noise" in found.text


SPACE = ParameterSpace((Parameter("a", "m", 0.1, 10.0, 1.0, "log"), Parameter("b", "m", 0.1, 10.0, 1.0, "log")))
LINEAR = ParameterSpace((Parameter("a", "m", -10.0, 10.0, 1.0), Parameter("b", "m", -10.0, 10.0, 2.0)))


def hessian_of(space, point, gradient):
    """Of squares that see one combination alone, whose gradient by the values is given."""
    row = gradient(space.from_unit(point)) * space.derivative(space.from_unit(point))
    return 1e6 * np.outer(row, row)


@given(st.floats(0.1, 0.9), st.floats(0.1, 0.9), st.sampled_from([(1, 1, "a*b"), (1, -1, "a/b"), (2, 1, "a^2*b")]))
def test_products_are_named(x, y, case):
    p, q, name = case
    hessian = hessian_of(SPACE, np.array([x, y]), lambda v: np.array([p / v[0], q / v[1]]))
    assert combined(SPACE, np.array([x, y]), hessian) == [(["a", "b"], f"only {name} is determined")]


def spring_and_damper(stiffness, damping):
    """A sine of 1 Hz, with noise on the force."""
    time = np.arange(0, 8, 0.01)
    stroke, velocity = 0.01 * np.sin(2 * np.pi * time), 0.02 * np.pi * np.cos(2 * np.pi * time)
    force = stiffness * stroke + damping * velocity + 0.1 * np.random.default_rng(0).standard_normal(len(time))
    experiment = Experiment("sine", "sine", time, {"displacement": stroke}, {}, 1.0, 0.01)
    units = {"displacement": "m", "force": "N"}
    return Campaign("spring and damper", "simulated", {}, (Measurement(experiment, {"force": force}, units),))


class Product(Model):
    """A gain that is a product of two parameters."""

    name = "product"
    parameters = (Parameter("a", "N/m", 10.0, 1e4, 100.0, "log"), Parameter("b", "1", 1.0, 1e3, 10.0, "log"))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": s.a * s.b * s.displacement})


def test_a_product_is_one_solution_with_the_combination_named(tmp_path):
    _, tree = identify(spring_and_damper(2000, 0), Product(), Settings(jobs=1), out=tmp_path / "run")
    assert list(tree["modes"].children) == ["m1"]
    assert set(tree["modes/m1"]["verdict"].values) == {TOGETHER}
    told = summary(tree, tmp_path)
    assert [finding["text"] for finding in told["findings"]] == ["a, b cannot be told apart: only a*b is determined."]
    assert (told["green"], told["trusted"]) == (False, True)


class Sum(Model):
    """A stiffness that is a sum of two parameters, beside a damping."""

    name = "sum"
    parameters = (
        Parameter("a", "N/m", 1.0, 1e5, 100.0, "log"),
        Parameter("b", "N/m", 1.0, 1e5, 100.0, "log"),
        Parameter("d", "N s/m", 1.0, 1e4, 100.0, "log"),
    )
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": (s.a + s.b) * s.displacement + s.d * s.velocity})


@pytest.mark.slow
def test_a_sum_is_one_solution_and_what_stands_beside_it_is_sampled(tmp_path):
    _, tree = identify(spring_and_damper(2000, 200), Sum(), Settings(jobs=1), out=tmp_path / "run")
    assert list(tree["modes"].children) == ["m1"]
    told = summary(tree, tmp_path)
    assert [finding["text"] for finding in told["findings"]] == ["a, b cannot be told apart: only a + b is determined."]
    assert (told["green"], told["trusted"]) == (False, True)
    found = told["modes"][0]["parameters"]
    assert [found[name]["verdict"] for name in "abd"] == [TOGETHER, TOGETHER, "identified"]
    assert found["d"]["q05"] < 200 < found["d"]["q95"]


def test_sums_are_named_and_what_is_determined_is_not():
    point = LINEAR.to_unit([1.0, 2.9])
    assert combined(LINEAR, point, hessian_of(LINEAR, point, lambda _: np.array([1.0, 1.0]))) == [
        (["a", "b"], "only a + b is determined")
    ]
    assert combined(LINEAR, point, 1e6 * np.eye(2)) == []
    assert combined(LINEAR, point, np.diag([1e6, 1e-3])) == []


class Valley:
    """Squares of ``a b - 1`` with a slope along the valley so small that no sampler would see it."""

    def __init__(self, hills: float = 0.0) -> None:
        self.space, self.hills = LINEAR, hills

    def terms(self, u):
        a, b = u[:, 0] * 2 + 0.2, u[:, 1] * 2 + 0.2
        return 1e3 * (a * b - 1), 1e3 * 2 * np.stack([b, a], axis=1), self.hills * np.cos(4 * np.pi * u[:, 0])

    def evaluate(self, u):
        residual, row, hill = self.terms(u)
        slope = np.zeros_like(row)
        slope[:, 0] = -4 * np.pi * self.hills * np.sin(4 * np.pi * u[:, 0])
        return residual**2 / 2 + hill, residual[:, None] * row + slope, row[:, :, None] * row[:, None, :]

    def log_posterior(self, u):
        return -self.evaluate(u)[0]


@pytest.mark.parametrize(("hills", "solutions"), [(0.0, 1), (50.0, 2)])
def test_minima_along_a_curved_valley_are_one_unless_a_hill_parts_them(hills, solutions):
    valley = Valley(hills)
    places = np.array([0.25, 0.75])
    starts = np.stack([places, (1 / (places * 2 + 0.2) - 0.2) / 2], axis=1)
    minima = merge(refine(valley.evaluate, starts))
    assert len(minima) == 2
    assert len(without_joined(valley, minima)) == solutions


@settings(max_examples=6, deadline=None)
@given(st.sampled_from([1e-3, 1e3]), st.sampled_from([1e-3, 1e3]), st.sampled_from([1e-3, 60.0]))
def test_another_unit_gives_the_same_point_of_the_range(force, stroke, time):
    """A campaign in other units of force, stroke and time: the estimates are the converted ones, minima alike."""
    model = find_model("kelvin_voigt_damper")
    own = locate_minima(SINES, model, Settings(jobs=1))
    other = locate_minima(in_units(SINES, force, stroke, time), model, Settings(jobs=1))
    assert other.minima[0].point == pytest.approx(own.minima[0].point, abs=2e-3)
    assert best_of(other)["c"] == pytest.approx(best_of(own)["c"] * force / stroke, rel=1e-3)
    assert best_of(other)["d"] == pytest.approx(best_of(own)["d"] * force / stroke * time, rel=1e-3)


def in_units(campaign, force, stroke, time):
    """The campaign as numbers in other units, taken for SI."""

    def changed(one):
        experiment = replace(
            one.experiment,
            time=one.time * time,
            inputs={name: values * stroke for name, values in one.experiment.inputs.items()},
            frequency=one.experiment.frequency / time,
            amplitude=one.experiment.amplitude * stroke,
        )
        return replace(one, experiment=experiment, outputs={n: v * force for n, v in one.outputs.items()})

    return replace(campaign, measurements=tuple(changed(one) for one in campaign.measurements))


def test_what_was_widened_is_the_difference_of_two_spaces():
    (found,) = widenings(SPACE, SPACE.farther([0, 1]))
    assert (found.name, found.before, found.after) == ("b", (0.1, 10.0), (0.1, 100.0))
    assert str(found).startswith("The range of b was widened from 0.1 … 10 to 0.1 … 100 m")


def test_a_solution_that_is_not_converged_is_named_with_the_parameter_and_a_cure():
    width = np.array([1e-2, 1e-3])

    def density(u):
        return -0.5 * np.sum(((u - 0.5) / width) ** 2, axis=1)

    def told(chains):
        unread = dict.fromkeys(("minimum", "noise_hessian", "near", "sampled", "evidence", "probability", "profile"))
        return PosteriorMode(name="m2", chains=chains, **unread).unconverged(("c", "d"))

    chains = sample_mode(density, np.full(2, 0.5), np.diag(width**2), 3, SampleSettings(max_steps=60))
    text = told(replace(chains, tau=np.array([2.0, 5.0])))
    assert text.startswith("m2: ")
    assert "steps are fewer than 100 tau" in text
    assert "d mixes worst: narrow its range (--bounds d=…), fix it (--fix d=…)" in text
    assert told(replace(chains, converged=True)) == ""
    assert told(Chains.none(2, "not sampled")) == "m2: not sampled."
