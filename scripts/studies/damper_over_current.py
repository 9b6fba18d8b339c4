"""A magneto-rheological damper over current, a stroke left out. Writes reports/conditions/damper_over_current.md.

    python scripts/studies/damper_over_current.py [--data FOLDER] [--work FOLDER]

Measured: six sine strokes of a magneto-rheological damper at 0 A and as many at 0.5 A (mr_damper_sine) as one campaign
over current, Bouc-Wen damper. The evidence chooses between constant and linear: two currents determine no more. The
stroke of 10 mm at 1 Hz is left out at both currents and predicted by the laws; the band is that of 90 %, of parameters,
noise and model error. Not sampled (Laplace). A run that the work folder holds already is kept.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from conditions import measured
from report_page import ROOT, header, made_with, table


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "damper_over_current")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    file = options.work / "mr.json"
    if not file.exists():
        file.write_text(json.dumps(measured(options.data, options.work)), encoding="utf-8")
    found = json.loads(file.read_text(encoding="utf-8"))
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
    page = ROOT / "reports" / "conditions" / "damper_over_current.md"
    page.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
