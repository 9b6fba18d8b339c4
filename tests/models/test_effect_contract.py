"""What an effect can act on, what it may read of a test, and which issues its author sees."""

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.errors import InputError
from mofit.models import (
    TARGET_UNIT,
    Applied,
    Channel,
    Condition,
    Effect,
    Equations,
    Model,
    build_system,
    find_effect,
    find_model,
    incompatibility,
    with_effects,
)
from mofit.parameters import Parameter
from mofit.problem import build_problem
from mofit.simulation import lacking, require


class Lever(Model):
    """Torque of a spring over a lever; the length is a condition, and read twice."""

    name = "lever"
    parameters = (Parameter("k", "N/m", 1.0, 1e6, 100.0),)
    inputs = (Channel("angle", "rad"),)
    outputs = (Channel("torque", "N m"),)
    conditions = (Condition("length", "m", 0.5),)

    def equations(self, s):
        return Equations(outputs={"torque": s.k * s.length * s.length * s.angle})


class Scaled(Effect):
    """What it acts on, times 1 + e."""

    name = "scaled"
    parameters = (Parameter("e", "1", -1.0, 1.0, 0.1, neutral=0.0),)

    def __init__(self, *on: str) -> None:
        self.on = on

    def apply(self, s, value):
        return Applied((1 + s.e) * value)


class Clocked(Effect):
    """The output plus the time of the campaign."""

    name = "clocked"
    on = ("output",)
    parameters = (Parameter("b", TARGET_UNIT, -1.0, 1.0, 0.1, neutral=0.0),)
    inputs = (Channel("time", "s"),)
    conditions = (Condition("start_time", "s"), Condition("sample_interval", "s"))

    def apply(self, s, value):
        return Applied(value + s.b * (s.start_time + s.time + 1000 * s.sample_interval))


def torque(model, p, angle=0.2, length=0.5):
    return float(build_system(model).out([], [angle], p, [length]))


@pytest.mark.parametrize(
    ("on", "power"), [("k", 1), ("length", 2), ("angle", 1), ("torque", 1), ("output", 1), ("nothing", None)]
)
def test_acts_on_whatever_the_model_names(on, power):
    effect = Scaled(on)
    if power is None:
        assert incompatibility(effect, Lever()) == "acts on nothing, which model 'lever' does not have"
        with pytest.raises(InputError, match="acts on nothing"):
            with_effects(Lever(), effect)
        return
    assert incompatibility(effect, Lever()) is None
    model = with_effects(Lever(), effect)
    assert torque(model, [100.0, 0.1]) == pytest.approx(torque(Lever(), [100.0]) * 1.1**power)


def test_takes_the_first_target_that_the_model_has():
    model = with_effects(Lever(), Scaled("nothing", "length", "torque"))
    assert model.effects[0][1] == "length"


def test_effects_on_one_parameter_follow_each_other():
    class More(Scaled):
        name = "more"
        parameters = (Parameter("e2", "1", -1.0, 1.0, 0.1, neutral=0.0),)

        def apply(self, s, value):
            return Applied(value + s.e2)

    model = with_effects(with_effects(Lever(), Scaled("k")), More("k"))
    assert torque(model, [100.0, 0.5, 7.0]) == pytest.approx(157 * 0.25 * 0.2)


def test_needs_are_checked_and_named():
    class Needy(Scaled):
        needs = ("mass or angle", "lengt")

    reason = incompatibility(Needy("k"), Lever())
    assert reason == "needs lengt, which model 'lever' does not have"
    with pytest.raises(InputError, match="Did you mean 'length'"):
        with_effects(Lever(), Needy("k"))


def test_unit_of_what_it_acts_on():
    assert with_effects(Lever(), Clocked()).parameters[-1].unit == "N m"
    backlash = find_effect("backlash")
    units = {m: with_effects(find_model(m), backlash) for m in ("maxwell_tyre", "maxwell_damper")}
    assert {m: (extended.parameters[-1].unit, extended.states[-1].unit) for m, extended in units.items()} == {
        "maxwell_tyre": ("rad", "rad"),
        "maxwell_damper": ("m", "m"),
    }


def test_two_effects_share_time_and_conditions():
    both = with_effects(find_model("maxwell_tyre"), find_effect("drift"), find_effect("wheel_order"))
    assert [channel.name for channel in both.inputs] == ["slip_angle", "time"]
    names = [condition.name for condition in both.conditions]
    assert len(names) == len(set(names))


def campaign(start: float | None) -> Campaign:
    time = 5.0 + np.arange(200) * 0.02
    angle = np.sin(time)
    experiment = Experiment("one", "free", time, {"angle": angle}, start_time=start)
    expected = 25 * angle + 0.3 * (100 + (time - 5.0) + 20)
    return Campaign("c", "simulated", {}, (Measurement(experiment, {"torque": expected}, {}),))


def test_time_start_and_sampling_come_from_the_test():
    model = with_effects(Lever(), Clocked())
    problem = build_problem(model, campaign(100.0))
    values = problem.space.to_unit(np.array([[100.0, 0.3]]))
    assert problem.objectives(values)[0] == pytest.approx(0, abs=1e-9)


def test_a_test_without_start_time_is_refused_only_where_it_is_needed():
    model = with_effects(Lever(), Clocked())
    assert [issue.message for issue in lacking(model, campaign(None))] == [
        "model 'lever+clocked' needs condition 'start_time' in s"
    ]
    with pytest.raises(InputError, match="start_time"):
        require(model, campaign(None))
    require(Lever(), campaign(None))


def test_rest_may_be_implicit():
    class Fed(Effect):
        """The state acts back on the input."""

        name = "fed"
        on = ("x",)
        parameters = (Parameter("g", "1", 0.0, 1.0, 0.1, neutral=0.0),)

        def apply(self, s, value):
            return Applied(value - s.g * s.y)

    class Follower(Model):
        name = "follower"
        states = (Channel("y", "m"),)
        inputs = (Channel("x", "m"),)
        outputs = (Channel("z", "m"),)

        def equations(self, s):
            return Equations(outputs={"z": 1 * s.y}, derivatives={"y": s.x - s.y}, initial={"y": s.x})

    system = build_system(with_effects(Follower(), Fed()))
    # y = x - g y, iterated from zero
    assert float(system.initial([1.0], [0.05], [])) == pytest.approx(1 / 1.05, abs=2e-4)
    assert float(system.initial([1.0], [0.0], [])) == 1.0


def test_issues_of_an_own_effect_are_named_together(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(
        "from mofit.models import Applied, Effect\n"
        "from mofit.parameters import Parameter\n"
        "class Own(Effect):\n"
        "    name = 'own'\n"
        "    on = 'torque'\n"
        "    parameters = (Parameter('a', '1', 0, 1, 0.5), Parameter('b', '1', 0, 1, 0.5, grid=(2.0,)))\n"
        "    def apply(self, s, value):\n"
        "        return Applied(value)\n"
    )
    with pytest.raises(InputError) as caught:
        find_effect(str(path))
    text = str(caught.value)
    assert "'on' is one text" in text
    assert "no parameter has a neutral value" in text
    assert "grid value 2 lies outside [0, 1]" in text


def test_abstract_bases_in_an_own_file_are_passed_over(tmp_path):
    path = tmp_path / "family.py"
    path.write_text(
        "from mofit.models import Applied, Effect\n"
        "from mofit.parameters import Parameter\n"
        "class Family(Effect):\n"
        "    on = ('output',)\n"
        "    parameters = (Parameter('a', '1', -1, 1, 0.5, neutral=0.0),)\n"
        "class Member(Family):\n"
        "    name = 'member'\n"
        "    def apply(self, s, value):\n"
        "        return Applied(value + s.a)\n"
    )
    assert type(find_effect(str(path))).__name__ == "Member"
    assert find_effect(str(path)).typical == 0.5


def test_size_neutral_and_grid_follow_from_the_parameters():
    order, springpot = find_effect("wheel_order"), find_effect("springpot")
    assert order.size == ("A_wc", "A_ws")
    assert order.typical == pytest.approx(14 * np.sqrt(2))
    assert order.grid_points == [{}]
    assert springpot.size == ("c_f",)
    assert springpot.neutral == {"c_f": 0.0, "a_f": 0.25}
    assert [point["a_f"] for point in springpot.grid_points] == list(springpot.grid["a_f"])


def test_an_input_may_change_its_rate_along():
    class Slower(Effect):
        name = "slower"
        on = ("displacement",)
        parameters = (Parameter("e", "1", -1.0, 1.0, 0.5, neutral=0.0),)

        def apply(self, s, value):
            return Applied((1 - s.e) * value, inputs={"velocity": (1 - s.e) * s.velocity})

    model = with_effects(find_model("kelvin_voigt_damper"), Slower())
    system = build_system(model)
    values = {"c": 100.0, "p": 0.0, "d": 10.0, "F_0": 0.0, "e": 0.5}
    force = system.out([], [0.1, 1.0], [values[name] for name in system.parameters], [])
    assert float(force) == pytest.approx(0.5 * (100 * 0.1 + 10 * 1.0))
