"""One more test of a campaign's specimen, as a diagnosis proposed it.

    python scripts/withheld/append.py DIR RESULTS --out NEXT [--campaigns CAMPAIGNS]

A result RESULTS/<name>.json may explain the gap and propose a test that discriminates between its candidate models.
Then NEXT/<name>.nc is the campaign with that test run and added. CAMPAIGNS is the folder of the campaigns diagnosed:
DIR/campaigns, or the NEXT of an earlier round. The labels stay blinded: they are opened to run the test, and nothing of
them shows.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
from blinded_labels import read_labels
from campaign_writer import extend_file
from hidden import case_of, slot_of
from respond import respond
from rig_tests import RAMP, RATE, SPEED, RigTest, phases
from specimen import add_noise
from tally import Pairing, advises

#: between the last test and the added one, s
PAUSE = 30.0


def main() -> None:
    """Run what was proposed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of generate.py")
    parser.add_argument("results", type=Path, help="folder with one JSON per campaign")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--campaigns", type=Path, help="folder of the campaigns diagnosed; that of generate.py")
    options = parser.parse_args()
    campaigns = options.campaigns or options.folder / "campaigns"
    options.out.mkdir(parents=True, exist_ok=True)
    labels = read_labels(options.folder / "labels.blinded")
    for path in sorted(options.results.glob("*.json")):
        result, target = json.loads(path.read_text()), options.out / f"{path.stem}.nc"
        if path.stem in labels and not target.exists() and advises(Pairing(path.stem, labels[path.stem], result)):
            append_test(campaigns / f"{path.stem}.nc", labels[path.stem], result["next_experiment"], target)
            print(path.stem, file=sys.stderr)


def append_test(source: Path, entry: Mapping[str, Any], spec: Mapping[str, Any], path: Path) -> None:
    """Write a copy of a campaign file with one more test, run on the same specimen.

    Parameters
    ----------
    source
        The campaign.
    entry
        Its label.
    spec
        ``kind`` (sine or step), ``amplitude`` [rad], ``frequency`` [Hz], ``duration`` [s]; ``conditions`` may hold
        ``longitudinal_velocity`` [m/s], and ``rate`` [Hz] is that of the samples, if not the usual one.
    path
        File to write.

    Raises
    ------
    ValueError
        For a test that this rig cannot run.
    """
    slot = slot_of(entry)
    number, end = _so_far(source)
    rng = slot.rng(10 + number)
    name = f"next_{number + 1}" if number else "next"
    test = replace(advised(spec, end + PAUSE, name), **phases(rng))
    (force,) = respond([(case_of(entry), test)])
    extend_file(source, path, test, add_noise(force, slot.noise, rng))


def _so_far(campaign: Path) -> tuple[int, float]:
    """How many tests were added to a campaign file, and when its last one ended, s."""
    with netCDF4.Dataset(campaign) as file:
        added = sum("next" in name for name in file.groups)
        ends = [g.start_time + g["time"][-1].item() for g in file.groups.values() if "start_time" in g.ncattrs()]
    return added, float(max(ends))


def advised(spec: Mapping[str, Any], start: float, name: str = "next") -> RigTest:
    """The test of a specification, begun at ``start`` [s]."""
    conditions = dict(spec.get("conditions") or {})
    speed = float(conditions.pop("longitudinal_velocity", SPEED))
    kind, amplitude, duration = spec["kind"], float(spec["amplitude"]), float(spec.get("duration") or 20.0)
    if conditions or kind not in ("sine", "step") or not speed > 0:
        raise ValueError(f"this rig runs sines and steps at other speeds, not {dict(spec)}")
    if kind == "step":
        if duration <= abs(amplitude) / RAMP + 1:
            raise ValueError(f"a step of {duration:g} s is too short")
        return RigTest(f"step_{name}", "step", duration, amplitude, speed=speed)
    frequency = float(spec["frequency"])
    # whole periods
    duration = max(round(duration * frequency), 2) / frequency
    rate = float(spec.get("rate") or RATE)
    return RigTest(f"sine_{name}", "sine", duration, amplitude, frequency, rate, speed, round(start, 2))


if __name__ == "__main__":
    main()
