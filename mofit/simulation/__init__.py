"""CasADi SX to SIMD machine code: batches of parameter sets through the tests of a campaign."""

from mofit.simulation.experiment import ExperimentData, experiment_data, objective_pairs
from mofit.simulation.requirements import exciting_channel, first_input, lacking, measured_outputs, require
from mofit.simulation.simulator import Simulator

__all__ = [
    "ExperimentData",
    "Simulator",
    "exciting_channel",
    "experiment_data",
    "first_input",
    "lacking",
    "measured_outputs",
    "objective_pairs",
    "require",
]
