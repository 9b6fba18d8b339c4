"""A virtual test rig: campaigns from a model, effects and noise."""

from mofit.simulation.virtual_rig.plan import Plan, read_plan
from mofit.simulation.virtual_rig.rig import run_plan, simulate

__all__ = ["Plan", "read_plan", "run_plan", "simulate"]
