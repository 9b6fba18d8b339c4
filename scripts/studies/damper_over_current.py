"""A magneto-rheological damper over current, a stroke left out. Writes reports/conditions/damper_over_current.md.

    python scripts/studies/damper_over_current.py [--data FOLDER] [--work FOLDER]

Measured: six sine strokes of a magneto-rheological damper at 0 A and as many at 0.5 A (mr_damper_sine) as one campaign
over current, Bouc-Wen damper. The evidence chooses between constant and linear: two currents determine no more. The
stroke of 10 mm at 1 Hz is left out at both currents and predicted by the laws; the band is that of 90 %, of parameters,
noise and model error. Not sampled (Laplace). A run that the work folder holds already is kept
if the same code made it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from kept import kept
from mofit.data import import_files, joined
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.results import summary
from report_page import ROOT, header, made_with, table, write_page


def measured(data: Path, work: Path) -> dict[str, Any]:
    """The magneto-rheological damper over current, a stroke left out."""
    maps = [ROOT / "data" / "maps" / f"mr_damper_{key}.toml" for key in ("0A", "0x5A")]
    parts = [import_files([data / "mr_damper_sine"], one) for one in maps]
    campaign = joined(parts, ["0A", "0.5A"])
    left = [name for name in campaign.tests if name.endswith("1Hz") and "0.1Hz" not in name]  # 10 mm
    chosen = Settings(over=("current",), sample=False, jobs=1, seed=0, evaluations=1500)
    folder, tree = identify(campaign, "bouc_wen_damper", chosen, hold_out=left, out=work / "mr_damper")
    found = summary(tree, folder)
    return {
        "laws": {row["parameter"]: row["law"] for row in found["laws"]["laws"]},
        "parameters": {name: [e["value"], e["sd"], e["unit"]] for name, e in found["modes"][0]["parameters"].items()},
        "chi_square": [found["laws"]["chi_square"], found["laws"]["freedom"]],
        "tests": [[one["test"], one["role"], one["nrmsd"], one["coverage"]] for one in found["held_out"]["tests"]],
    }


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "damper_over_current")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    found = kept(options.work / "mr.json", lambda: measured(options.data, options.work))
    chi_square, freedom = found["chi_square"]
    tests = [(n, role, f"{100 * e:.2f} %", f"{100 * c:.0f} %") for n, role, e, c in found["tests"]]
    lines = [
        *header("A damper over current", __doc__, "damper_over_current.py", made_with()),
        *table(("test", "role", "NRMSD", "samples in the 90 % band"), tests),
        *table(("parameter", "law over current"), list(found["laws"].items())),
        *table(
            ("parameter", "value", "sd", "unit"),
            [(n, f"{v:.4g}", f"{s:.2g}", u) for n, (v, s, u) in found["parameters"].items()],
        ),
        f"Chi square of the laws: {chi_square:.1f} with {freedom} estimates to spare.",
    ]
    write_page("conditions", lines, "damper_over_current.md")


if __name__ == "__main__":
    main()
