"""A virtual test rig: campaigns from a model, effects and noise."""

from mofit.simulate.plan import Plan, read_plan
from mofit.simulate.rig import run_plan, simulate

__all__ = ["Plan", "read_plan", "run_plan", "simulate"]
