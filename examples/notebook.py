"""A run in a notebook: open this file as one (VS Code, Jupytext), or run it after the tutorial's first seven steps.

python examples/notebook.py
"""

# %%
import arviz_stats
import matplotlib.pyplot as plt

import mofit
from mofit import plots

# %% The result is an xarray tree; everything in it has a unit and a name
tree = mofit.open("runs/zener")
tree["modes/m1"]

# %% ArviZ reads each mode
arviz_stats.summary(tree["modes/m1"], round_to="none")

# %% Every plot draws into the axes it is given, and returns them
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
plots.loop(tree, "sine_2Hz", ax=left)
plots.marginal(tree, "tau", ax=right).axvline(0.04, color="black", ls=":")  # the truth
figure.savefig("zener.png")

# %% The report, in a frame of its own
mofit.report_page(tree)

# %% A diagnosis displays itself, too
mofit.diagnose(mofit.read_campaign("my_rig.nc"), mofit.find_model("kelvin_voigt_damper"))
