"""FMUs against mofit's own simulation, through fmpy."""

import numpy as np
import pytest
from fmu_runs import (
    ROLLING,
    drive,
    fmu_of,
    needs_compiler,
    record,
    run,
    run_of,
    simulated,
    steer,
    stroke,
    validate_fmu,
)

from mofit.models import Channel, Equations, Model, find_effect, find_model, with_effects
from mofit.parameters import Parameter


class Pendulum(Model):
    """The second derivative of a channel; the equations do not read the channel itself."""

    name = "pendulum"
    parameters = (Parameter("J", "kg m^2", 0.1, 10.0, 2.0), Parameter("T", "s", 0.01, 1.0, 0.05, "log"))
    states = (Channel("lag", "rad/s"),)
    inputs = (
        Channel("angle", "rad"),
        Channel("turning", "rad/s", derivative_of="angle"),
        Channel("acceleration", "rad/s^2", derivative_of="turning"),
    )
    outputs = (Channel("torque", "N m"),)

    def equations(self, s):
        return Equations(
            outputs={"torque": s.J * s.acceleration + s.lag}, derivatives={"lag": (s.turning - s.lag) / s.T}
        )


class Decay(Model):
    """Nothing drives it."""

    name = "decay"
    parameters = (Parameter("T", "s", 0.01, 1.0, 0.2, "log"), Parameter("y_0", "m", -1.0, 1.0, 0.7))
    states = (Channel("y", "m"),)
    outputs = (Channel("displacement", "m"),)

    def equations(self, s):
        return Equations(outputs={"displacement": s.y}, derivatives={"y": -s.y / s.T}, initial={"y": s.y_0})


def extended(model, *effects):
    return with_effects(find_model(model), *(find_effect(name) for name in effects))


CASES = {
    "Maxwell damper": (find_model("maxwell_damper"), stroke(), 0.002, {}, {}),
    # the branch relaxes within a 20,000th of a sampling interval
    "stiff": (find_model("maxwell_damper"), stroke(), 0.002, {}, {"c_M": 1e7, "d_M": 1.0}),
    "Maxwell tyre": (find_model("maxwell_tyre"), steer(), 0.01, ROLLING, {}),
    "second branch": (extended("maxwell_damper", "second_branch"), stroke(), 0.002, {}, {"c_2": 2e4}),
    "two effects": (
        extended("maxwell_tyre", "dry_friction", "sensor_lowpass"), steer(), 0.01,
        {**ROLLING, "sample_interval": 0.01}, {"F_d": 50.0, "T_f": 8e-3},
    ),
    "effect of time": (
        extended("maxwell_damper", "warm_up"), stroke(), 0.002, {}, {"w_t": 0.2, "tau_t": 0.5},
    ),
    "Bouc-Wen damper": (find_model("bouc_wen_damper"), stroke(), 0.002, {"averaging_time": 0.01}, {"delta": 2e-3}),
    "without states": (find_model("tmeasy_curve"), steer(), 0.01, ROLLING, {}),
    "acceleration": (
        Pendulum(),
        [7.0 ** (k - 1) * np.sin(7 * np.arange(500) * 0.002 + k * np.pi / 2) for k in range(3)],
        0.002, {}, {},
    ),
    "free decay": (Decay(), [np.arange(300) * 0.01], 0.01, {}, {}),
    "oscillator": (find_model("duffing_oscillator"), [np.sin(40 * np.arange(800) * 1e-3)], 1e-3, {}, {"k_3": 50.0}),
}  # fmt: skip


@needs_compiler
@pytest.mark.parametrize(
    ("case", "fmi"),
    [*((case, "3") for case in CASES), ("Maxwell tyre", "2"), ("two effects", "2"), ("without states", "2")],
)
def test_an_fmu_is_valid_and_gives_the_outputs_of_mofit(case, fmi, tmp_path):
    model, inputs, step, conditions, changed = CASES[case]
    known = {p.name for p in model.parameters}
    assert set(changed) <= known, known
    test = record(model, inputs, step, [conditions[c.name] for c in model.conditions])
    tree = run_of(model, changed, {name: [value] for name, value in conditions.items()}, {"drive": test})
    path = fmu_of(tree, model, tmp_path, fmi=fmi)
    assert validate_fmu(str(path)) == []
    wanted = simulated(model, test, changed)
    assert np.ptp(wanted) > 0
    output = run(path, drive(tree, model, test), step)
    assert output == pytest.approx(wanted, abs=1e-6 * np.ptp(wanted))


@needs_compiler
def test_time_is_counted_from_the_start(tmp_path):
    model, _, step, _, changed = CASES["effect of time"]
    test = record(model, stroke(), step)
    tree = run_of(model, changed)
    path = fmu_of(tree, model, tmp_path)
    signals = drive(tree, model, test)
    plain = run(path, signals, step)
    signals["time"] += 100.0
    assert run(path, signals, step) == pytest.approx(plain, abs=1e-6 * np.ptp(plain))
