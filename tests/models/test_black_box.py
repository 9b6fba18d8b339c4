"""A user's simulator as a model: what it needs, which effects reach it, what its hash depends on."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from simulators import INPUTS, LINE, OUTPUTS, lagging_simulator, line, line_simulator

from mofit.errors import InputError
from mofit.models import (
    Addition,
    Applied,
    BlackBoxSystem,
    Channel,
    Effect,
    Record,
    Scaling,
    Simulator,
    build_system,
    find_effect,
    find_model,
    with_effects,
)
from mofit.models.extended_model import possible_targets
from mofit.parameters import Parameter


class Bending(Effect):
    """A state that follows the force."""

    name = "bending"
    on = ("force",)
    parameters = (Parameter("a", "m/N", 0.0, 1.0, 0.1, neutral=0.0),)
    states = (Channel("bent", "m"),)

    def apply(self, s, value):
        """The force itself."""
        return Applied(value, derivatives={"bent": s.a * value - s.bent})


class SoftMount(Addition):
    """The input less what the force bends the mount: a loop through the simulator."""

    name = "soft_mount"
    on = ("displacement",)
    parameters = (Parameter("m", "1", 0.0, 1.0, 0.1, neutral=0.0),)

    def term(self, s):
        """What the mount gives way."""
        return -s.m * s.bent


class Ageing(Scaling):
    """A parameter that changes with time."""

    name = "ageing"
    on = ("k",)
    parameters = (Parameter("w", "1/s", -1.0, 1.0, 0.1, neutral=0.0),)

    def change(self, s, value):
        """Linear in the input, which stands for time."""
        return s.w * s.displacement


class Stiffer(Scaling):
    """A parameter that is wrong by a constant."""

    name = "stiffer"
    on = ("k",)
    parameters = (Parameter("q", "1", -1.0, 1.0, 0.1, neutral=0.0),)


def test_a_simulator_without_effects_sees_inputs_and_gives_outputs_as_they_are():
    system = build_system(line_simulator())
    assert isinstance(system, BlackBoxSystem)
    assert system.bare_inputs
    assert system.bare_outputs
    assert system.reaching == {"k", "b"}
    assert (system.inputs, system.outputs, system.parameters) == (("displacement",), ("force",), ("k", "b"))


def test_effects_reach_inputs_outputs_parameters_and_conditions():
    assert set(possible_targets(lagging_simulator())) == {"displacement", "force", "k", "d", "T", "load"}


def test_an_effect_on_the_output_does_not_reach_the_simulator():
    system = build_system(with_effects(line_simulator(), find_effect("force_gain")))
    assert system.bare_inputs
    assert not system.bare_outputs
    assert system.reaching == {"k", "b"}


def test_a_constant_change_of_a_parameter_reaches_the_simulator():
    system = build_system(with_effects(line_simulator(), Stiffer()))
    assert system.reaching == {"k", "b", "q"}
    values = np.asarray(system.constants([2.0, 0.5, 0.1], ca.DM(0, 1))).ravel()
    assert values == pytest.approx([2.2, 0.5])


@pytest.mark.parametrize("effects", [(Ageing(),), (Bending(), SoftMount())])
def test_what_would_act_inside_is_out_of_reach(effects):
    with pytest.raises(InputError, match="out of reach, inside the simulator"):
        build_system(with_effects(line_simulator(), *effects))


def test_an_inner_quantity_is_out_of_reach():
    with pytest.raises(InputError, match="out of reach, inside the simulator 'line'"):
        with_effects(line_simulator(), find_effect("cubic_stiffness"))


def test_the_hash_changes_with_the_function_and_with_an_effect():
    plain = line_simulator(fingerprint="1")
    hashes = {
        build_system(model).hash()
        for model in (
            plain,
            line_simulator(fingerprint="2"),
            with_effects(plain, Stiffer()),
            with_effects(plain, find_effect("force_gain")),
        )
    }
    assert len(hashes) == 4
    assert build_system(plain).hash() == build_system(line_simulator(fingerprint="1")).hash()


def test_the_fingerprint_follows_the_source(tmp_path):
    source = (
        "from mofit import Channel, Parameter, Simulator\n"
        "def gain(record, parameters):\n"
        "    return parameters['k'] * record.inputs['x']\n"
        "rig = Simulator(gain, [Parameter('k', '1', 0.0, 2.0, 1.0)], [Channel('x', 'm')], [Channel('y', 'm')])\n"
    )
    file = tmp_path / "rigs.py"
    file.write_text(source)
    first = find_model(f"{file}:rig")
    assert find_model(str(file)).fingerprint == first.fingerprint
    file.write_text(source.replace("return ", "return 2 * "))
    assert find_model(f"{file}:rig").fingerprint != first.fingerprint
    with pytest.raises(InputError, match="rig"):
        find_model(f"{file}:ri")


def test_all_that_is_wrong_with_a_simulator_is_told_at_once():
    with pytest.raises(InputError) as caught:
        Simulator(3, ["k"], [], [], name="bad")
    messages = [issue.message for issue in caught.value.issues]
    assert messages == ["its function is a int", "parameters hold a str", "it has no outputs"]
    assert all(issue.where == "simulator 'bad'" for issue in caught.value.issues)


def test_a_simulator_is_named_after_its_function():
    found = Simulator(line, LINE, INPUTS, OUTPUTS)
    assert (found.name, found.title) == ("line", "line")


@pytest.mark.parametrize(
    ("interpolation", "between"),
    [("hold", [0.0, 1.0, 4.0]), ("linear", [0.5, 2.5, 6.5]), ("cubic", [0.25, 2.25, 6.25])],
)
def test_a_record_knows_its_inputs_between_samples(interpolation, between):
    record = Record("parabola", np.arange(4) * 0.1, {"displacement": np.arange(4.0) ** 2}, {}, interpolation)
    curve = record.curve("displacement")
    assert curve([0.05, 0.15, 0.25]) == pytest.approx(np.array(between)[:, None])
    assert curve(record.time) == pytest.approx(record.inputs["displacement"][:, None])
    others = [replace(record, interpolation=other) for other in ("hold", "linear", "cubic") if other != interpolation]
    assert record.digest not in [other.digest for other in others]
