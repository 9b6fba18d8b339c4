"""What was identified, for other programs: parameters as TOML or CSV, the model as CasADi function or C source."""

from mofit.export.functions import c_source, identified_function, model_of_run
from mofit.export.parameters import parameters_csv, parameters_toml

__all__ = [
    "c_source",
    "identified_function",
    "model_of_run",
    "parameters_csv",
    "parameters_toml",
]
