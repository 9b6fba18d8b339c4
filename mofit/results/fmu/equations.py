"""The equations of an FMU in C: CasADi's code of the model, and a header with its sizes and start values."""

from __future__ import annotations

import json

import casadi as ca

from mofit.models.model import TIME
from mofit.results.fmu.variables import Contents

#: error of an integrator step relative to the size of the states, unless the importer asks for another
TOLERANCE = 1e-8


def equations_source(contents: Contents, identifier: str) -> tuple[str, str]:
    r"""Source of the functions, and header ``model.h``.

    The functions, with states :math:`x`, inputs :math:`u`, parameters :math:`p` and conditions :math:`c`:
    ``slope`` :math:`(x, u, p, c) \mapsto \dot x`, ``linearised``
    :math:`(x, u, \dot u, p, c) \mapsto (\dot x, \partial \dot x / \partial x, (\partial \dot x / \partial u) \dot u)`,
    ``output`` :math:`(x, u, p, c) \mapsto y` and ``initial`` :math:`(u, p, c) \mapsto x_0`, each with the identifier
    before its name. CasADi's text refers to nothing but ``math.h``.
    """
    functions = _functions(contents, identifier)
    generator = ca.CodeGenerator(
        f"{identifier}_equations", {"with_header": False, "with_export": False, "casadi_int": "int", "verbose": False}
    )
    for function in functions.values():
        generator.add(function)
    return str(generator.dump()), _header(contents, functions)


def _functions(contents: Contents, identifier: str) -> dict[str, ca.Function]:
    system = contents.system
    x, u, p, c = system.rhs.sx_in()
    rate = ca.SX.sym("rate", u.shape)
    xdot = system.rhs(x, u, p, c)
    jacobian, drift = ca.densify(ca.jacobian(xdot, x)), ca.densify(ca.jtimes(xdot, u, rate))
    found = {
        "slope": ([x, u, p, c], [xdot]),
        "linearised": ([x, u, rate, p, c], [xdot, jacobian, drift]),
        "output": ([x, u, p, c], [system.out(x, u, p, c)]),
        "initial": ([u, p, c], [system.initial(u, p, c)]),
    }
    return {
        name: ca.Function(f"{identifier}_{name}", arguments, [ca.densify(result) for result in results])
        for name, (arguments, results) in found.items()
    }


def _header(contents: Contents, functions: dict[str, ca.Function]) -> str:
    system, each = contents.system, list(functions.values())
    places = {signal.source: k for k, signal in enumerate(contents.signals)}
    source = {name: (places[s.source], order) for s in contents.signals for name, order in s.orders.items()}
    drives = [source.get(name, (-1, 0)) for name in system.inputs]
    assert all(place >= 0 for name, (place, _) in zip(system.inputs, drives, strict=True) if name != TIME.name)
    starts = [v.start for v in contents.variables if v.causality in ("input", "parameter")]
    nominal = [variable.nominal for _, variable in contents.of("local")]
    defines = {
        "MODEL_TOKEN": json.dumps(contents.token),
        "MODEL_TOLERANCE": repr(TOLERANCE),
        "STATES": len(system.states),
        "INPUTS": len(system.inputs),
        "PARAMETERS": len(system.parameters),
        "CONDITIONS": len(system.conditions),
        "OUTPUTS": len(system.outputs),
        "CHANNELS": len(contents.signals),
        "ORDERS": contents.orders,
        "MODEL_POINTERS": max(8, *(f.sz_arg() for f in each), *(f.sz_res() for f in each)),
        "MODEL_INTEGERS": max(f.sz_iw() for f in each),
        "MODEL_WORK": max(f.sz_w() for f in each),
    }
    return "\n".join(
        [
            "/* Sizes and start values of the model: as modelDescription.xml has them. */",
            "#ifndef MODEL_H",
            "#define MODEL_H",
            "",
            *(f"#define {name} {value}" for name, value in defines.items()),
            "",
            *(f"#define model_{name} {function.name()}" for name, function in functions.items()),
            *(f"int model_{name}(const double**, double**, int*, double*, int);" for name in functions),
            "",
            "/* inputs by signal and order of derivative, parameters, conditions */",
            _array("double", "model_start", starts),
            "/* sizes of the states */",
            _array("double", "model_nominal", nominal),
            "/* signal of every input of the equations, -1 for time, and the order of its derivative */",
            _array("int", "model_channel", [place for place, _ in drives]),
            _array("int", "model_order", [order for _, order in drives]),
            "/* highest derivative of every signal that the equations read */",
            _array("int", "model_read", [signal.read for signal in contents.signals]),
            "",
            "#endif",
            "",
        ]
    )


def _array(kind: str, name: str, values: list[float | None] | list[int] | list[float]) -> str:
    return f"static const {kind} {name}[{max(1, len(values))}] = {{{', '.join(map(repr, values)) or '0'}}};"
