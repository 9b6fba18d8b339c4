"""A model on the kernel, with a fixed number of steps so that two models are integrated alike."""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.models import Model, build_system
from mofit.simulation import ExperimentData, Simulator


def simulator(
    model: Model,
    tests: Sequence[tuple[Mapping[str, FloatArray], Mapping[str, float]]],
    step: float,
    free: Sequence[str] = (),
    steps: int = 4,
) -> Simulator:
    """The model on tests, each with its channels and conditions; ``time`` and what follows from it are added."""
    experiments = []
    for number, (channels, given) in enumerate(tests):
        count = len(next(iter(channels.values())))
        columns = {"time": np.arange(count) * step, **channels}
        conditions = {"sample_interval": step, "record_length": (count - 1) * step, **given}
        experiments.append(
            ExperimentData(
                name=str(number),
                step=step,
                inputs=np.stack([columns[channel.name] for channel in model.inputs], axis=1),
                interpolation="cubic",
                conditions=np.array([conditions.get(c.name, c.default) for c in model.conditions], dtype=float),
                measured=np.zeros((count, len(model.outputs))),
                weights=np.ones((count, len(model.outputs))),
            )
        )
    return Simulator(build_system(model), experiments, free, steps=steps)


def point(model: Model, values: Mapping[str, float]) -> FloatArray:
    """One parameter set in the model's order, nominal where not given; shape (1, p)."""
    return np.array([[values.get(p.name, p.nominal) for p in model.parameters]])


def output(
    model: Model,
    values: Mapping[str, float],
    channels: Mapping[str, FloatArray],
    step: float,
    conditions: Mapping[str, float] | None = None,
    steps: int = 4,
) -> FloatArray:
    """First output of one test, shape (n,)."""
    return simulator(model, [(channels, conditions or {})], step, steps=steps).simulate(point(model, values))[0][
        0, :, 0
    ]


def transfer(
    model: Model, values: Mapping[str, float], omega: float, conditions: Mapping[str, float] | None = None
) -> complex:
    """First output over the first input at a frequency [rad/s], linearised at zero; a second input is its rate."""
    system = build_system(model)
    x, u = ca.SX.sym("x", len(system.states)), ca.SX.sym("u", len(system.inputs))
    given = dict(conditions or {})
    c = [given.get(condition.name, condition.default) for condition in model.conditions]
    p = point(model, values)[0]
    rates, y = system.rhs(x, u, p, c), system.out(x, u, p, c)[0]
    blocks = [ca.jacobian(f, at) for f in (rates, y) for at in (x, u)]
    zero = [np.zeros(x.numel()), np.zeros(u.numel())]
    a, b, c_, d = (block.full() for block in ca.Function("f", [x, u], blocks)(*zero))
    inputs = np.array([1.0, 1j * omega])[: u.numel()]
    return complex((c_ @ np.linalg.solve(1j * omega * np.eye(len(a)) - a, b @ inputs) + d @ inputs)[0])
