"""Simulators that crash, hang, fail or answer, as their parameter k says."""

import os
import signal
import time

import numpy as np

CRASH, EXIT, HANG, NAN, RAISE = 3.0, 4.0, 5.0, 6.0, 7.0


def hostile(record, parameters):
    k = parameters["k"]
    if k == CRASH:
        os.kill(os.getpid(), signal.SIGSEGV)
    if k == EXIT:
        os._exit(7)
    if k == HANG:
        time.sleep(3600)
    if k == RAISE:
        raise ValueError("no solution at k = 7")
    force = k * record.inputs["displacement"]
    if k == NAN:
        force[record.time >= 0.3] = np.nan
    return force


def process_of(record, parameters):
    """The process that evaluates, at every sample."""
    return np.full(len(record.time), float(os.getpid()))


def two_outputs(record, parameters):
    return {"force": parameters["k"] * record.time, "power": record.time**2}


class Line:
    """With its sensitivities."""

    def __call__(self, record, parameters):
        return parameters["k"] * record.time

    def sensitivities(self, record, parameters, free):
        slopes = {"k": record.time, "wild": np.full(len(record.time), np.nan)}
        outputs = self(record, parameters)[:, np.newaxis]
        return outputs, np.stack([slopes[name] for name in free], axis=-1)[:, np.newaxis]


def chatter(record, parameters):
    os.write(1, b"to standard output\n")
    os.write(2, b"to standard error\n")
    return record.time
