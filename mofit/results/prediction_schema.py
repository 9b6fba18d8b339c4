"""The layout of predictions: a table, and below it, in ``tests``, a group of signals per predicted test.

A result has it in the group ``held_out``, a prediction file (``mofit.prediction/1``) at its root.
"""

from __future__ import annotations

from mofit.results.layout import Group, Variable, optional

#: the table of predicted tests
HELD_OUT = Group(
    {
        "role": Variable("record", "1", "whether it was fitted, held out or is new"),
        "scored_from": Variable("record", "s", "time at the start that is not scored"),
        "nrmsd": Variable("record [output]", "1", "NRMSD of the median"),
        "rms": Variable("record [output]", "", "root mean square error of the median"),
        "coverage": Variable("record [output]", "1", "share of the scored samples in the 90 % band"),
        "range": Variable("record [output]", "", "peak-to-peak of the median"),
        "parameter_sd": Variable("record [output]", "", "part of the parameters: spread over the draws"),
        "noise_sd": Variable("record [output]", "", "part of the noise: standard deviation"),
        "model_error": Variable("record [output]", "", "part of the model: gap times range"),
    },
    ("draws", "spread", "gap", "noise", "scoped"),
)
#: the signals of a predicted test
RECORD = Group(
    {
        "input": optional("time", "", ""),
        "median": Variable("time [output]", "", "median of the prediction"),
        "parameter_low": Variable("time [output]", "", "5 % quantile by the parameters alone"),
        "parameter_high": Variable("time [output]", "", "95 % quantile by the parameters alone"),
        "low": Variable("time [output]", "", "5 % quantile of a new measurement"),
        "high": Variable("time [output]", "", "95 % quantile of a new measurement"),
        "measured": Variable("time [output]", "", "measured output"),
        "residual": Variable("time [output]", "", "measured minus median"),
        "scored": Variable("time [output]", "1", "1 where it is scored"),
    }
)
