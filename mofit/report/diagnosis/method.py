"""How the diagnosis works, in a few words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mofit.report.page import Section, Text


def method_section(data: Mapping[str, Any]) -> Section:
    """Method and limits."""
    floors = ", ".join(f"{test} {100 * floor:.2g} %" for test, floor in data["noise_floor"].items())
    return Section(
        "method",
        "Method",
        [
            Text(
                "Residuals and sensitivities are made white with the noise of each test. The model without effects "
                "is fitted with the calibration stages as priors; every effect is tried by a score test; the "
                "promising ones are fitted in full, alone and together, and compared by an information criterion "
                "that charges for every parameter and for having chosen. What the best explanation leaves is tested "
                "line by line: if that is more than noise, none of the known effects is to blame. Held-out: each "
                "test is predicted by fits to the others."
            ),
            Text(f"Noise floor (NRMSD): {floors}. Processor time {data['seconds']:.1f} s."),
        ],
    )
