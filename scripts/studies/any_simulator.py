"""What does mofit make of simulators that are plain Python functions? Writes reports/any_simulator/README.md.

    python scripts/studies/any_simulator.py [--only NAME ...] [--campaigns 100] [--work FOLDER] [--data FOLDER]

Functions around scipy's solve_ivp (`scripts/studies/any_simulator_cases.py`) are identified beside models with the same
equations in CasADi: a damper on four simulated sines, two tanks and a battery cell at nine charge states, measured by
others. Of each parameter the posterior means are compared, in standard deviations, and these: of all modes, each with
its probability, since two identifications may part a curved posterior into modes in different places. Chains are ten
times as long as usual, for means to a hundredth of a standard deviation. One simulation is
one record at one parameter set; they are bounded as stated. The error of the emulator is that of its log posterior at
fresh draws. A slow function (0.2 s per record) goes through the whole of `mofit identify` in two processes, and again
on two workers of a Dask cluster, one of which is killed on the way. Calibration takes a quick function on campaigns
whose parameters are drawn from the prior (Talts et al. 2018) and counts how often a 90 % interval contains the truth.
Rows that the work folder holds already are kept if the same code made them.
"""

from __future__ import annotations

import argparse
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import mofit
from any_simulator_cases import OpenCircuit
from calibration_cases import draw_campaign
from kept import kept, made_by
from mofit.data import Campaign
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import Model, find_model, with_effects
from mofit.results import simulations
from mofit.sampling import SampleSettings
from posterior_draws import draws
from records_cases import battery, tanks
from report_page import ROOT, header, table, write_page

SIMULATORS = ROOT / "scripts" / "studies" / "any_simulator_cases.py"
#: campaign of the damper
NUMBER = 3
#: seconds after which a worker of the cluster is killed: the search is on its way
KILLED = 20.0
#: largest shift of a mean that is asked for, in standard deviations
ASKED = 0.02
#: chains ten times as long as usual: means of two are compared to a hundredth of a standard deviation
LONG = SampleSettings(tau_multiple=1000.0, max_steps=20000)
#: half of a 90 % interval lies between these quantiles
INTERVAL = (0.05, 0.95)


def simulator(name: str) -> Model:
    """One of the study's."""
    return find_model(f"{SIMULATORS}:{name}_simulator")


def damper(data: Path) -> tuple[Campaign, Model, Model, int]:
    """The damper on simulated sines."""
    model, _, _, campaign, _ = draw_campaign("one mode", "white", NUMBER)
    return campaign, model, simulator("damper"), 2000


def two_tanks(data: Path) -> tuple[Campaign, Model, Model, int]:
    """Two equal tanks, the record for the estimation."""
    return tanks.campaign(data).select(["estimation"]), tanks.EqualTanks(), simulator("tanks"), 2000


def one_cell(data: Path) -> tuple[Campaign, Model, Model, int]:
    """A cell at nine charge states; its open-circuit voltages are an effect behind the simulator."""
    campaign = battery.campaign(data)
    tests = [test for test in campaign.tests if test.endswith("Cell1")]
    return campaign.select(tests), battery.ChargedCell(), with_effects(simulator("cell"), OpenCircuit()), 6000


BESIDE: dict[str, Callable[[Path], tuple[Campaign, Model, Model, int]]] = {
    "damper": damper,
    "tanks": two_tanks,
    "battery": one_cell,
}


#: The other rows.
OTHERS = ("slow", "cluster", "calibration")


def beside(name: str, data: Path) -> dict:
    """A function beside a model with equations."""
    campaign, model, function, limit = BESIDE[name](data)
    settings = Settings(seed=0, jobs=1, simulations=limit, sampling=LONG)
    here, there = (draws(campaign, one, settings) for one in (function, model))
    order = [here.names.index(name) for name in there.names]
    return {
        **here.about,
        "limit": limit,
        "names": there.names,
        "shift": ((here.mean[order] - there.mean) / there.sd).tolist(),
        "ratio": (here.sd[order] / there.sd).tolist(),
        "modes_of_equations": there.about["modes"],
        "seconds_of_equations": there.about["seconds"],
    }


def slow(work: Path) -> dict:
    """The whole job with 0.2 s per record."""
    _, _, truth, campaign, _ = draw_campaign("one mode", "white", NUMBER)
    began = time.perf_counter()
    folder, tree = identify(campaign, simulator("slow"), Settings(jobs=2), out=work / "slow_run")
    found = simulations(tree)
    assert found is not None
    mode = tree["modes/m1"].dataset
    low, high = mode["q05"].values, mode["q95"].values
    return {
        "seconds": time.perf_counter() - began,
        "simulations": found["count"],
        "error": found["emulators"]["m1"]["error"],
        "converged": bool(tree.attrs["converged"]),
        "inside": int(np.sum((low <= truth) & (truth <= high))),
        "parameters": len(truth),
        "folder": folder.name,
    }


def cluster(work: Path) -> dict:
    """The same on two Dask workers, one of which is killed."""
    from distributed import Client, LocalCluster

    alone = mofit.open(work / kept(work / "slow.json", lambda: slow(work))["folder"])
    _, _, _, campaign, _ = draw_campaign("one mode", "white", NUMBER)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as workers,
        Client(workers.scheduler_address, set_as_default=False) as client,
    ):
        before = client.run(os.getpid)
        killing = threading.Timer(KILLED, os.kill, (next(iter(before.values())), signal.SIGKILL))
        killing.start()
        began = time.perf_counter()
        settings = Settings(jobs=1, dask=workers.scheduler_address)
        _, tree = identify(campaign, simulator("slow"), settings, out=work / "cluster_run")
        killing.join()
        seconds, after = time.perf_counter() - began, client.run(os.getpid)
    here, there = (one["modes/m1"].dataset for one in (tree, alone))
    found, expected = simulations(tree), simulations(alone)
    assert found is not None
    assert expected is not None
    columns = ("value", "mean", "sd", "q05", "q95")
    return {
        "seconds": seconds,
        "simulations": found["count"],
        "killed": sorted(before.values()) != sorted(after.values()),
        "same": found["count"] == expected["count"]
        and all(np.array_equal(here[column].values, there[column].values) for column in columns),
    }


def covered(number: int) -> dict:
    """One campaign of the calibration: where the truth lies among the draws."""
    _, unit, _, campaign, _ = draw_campaign("one mode", "white", number)
    found = draws(campaign, simulator("quick"), Settings(seed=number, jobs=1))
    return {**found.about, "names": found.names, "place": found.below(unit).tolist()}


def beside_table(rows: dict[str, dict]) -> list[str]:
    """The functions beside equations."""
    columns = (
        "case",
        "parameters",
        "largest shift of a mean, sd",
        "sd ratio",
        "simulations",
        "emulator, nats",
        "s",
        "s, equations",
    )
    lines = [
        (
            name, len(row["names"]), f"{np.abs(row['shift']).max():.4f}",
            f"{min(row['ratio']):.3f} to {max(row['ratio']):.3f}", f"{row['simulations']} of {row['limit']}",
            f"{row['error']:.2g}", f"{row['seconds']:.0f}", f"{row['seconds_of_equations']:.0f}",
        )
        for name, row in rows.items()
    ]  # fmt: skip
    missed = [name for name, row in rows.items() if np.abs(row["shift"]).max() > ASKED]
    text = f"Asked for is a shift of at most {ASKED}"
    text += f"; not reached: {', '.join(missed)}." if missed else ", which all reach."
    return ["## Beside equations", "", *table(columns, lines), text, ""]


def coverage_table(rows: Sequence[dict]) -> list[str]:
    """How often the truth is inside."""
    place = np.array([row["place"] for row in rows])
    inside = (place >= INTERVAL[0]) & (place <= INTERVAL[1])
    count, error = inside.size, np.sqrt(0.9 * 0.1 / inside.size)
    columns = (
        "campaigns",
        "truth in the 90 % interval",
        "standard error if it is 90 %",
        "per parameter",
        "simulations",
    )
    shares = ", ".join(f"{100 * share:.0f} %" for share in inside.mean(axis=0))
    used = [row["simulations"] for row in rows]
    share = f"{100 * inside.mean():.1f} % of {count}"
    line = (len(rows), share, f"{100 * error:.1f} %", shares, f"{min(used)} to {max(used)}")
    worst = max(row["error"] for row in rows)
    text = f"The largest error of an emulator was {worst:.2g} nats; {sum(row['converged'] for row in rows)} converged."
    return ["## Calibration", "", *table(columns, [line]), text, ""]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="*", default=[], help=f"of {', '.join([*BESIDE, 'slow', 'calibration'])}")
    parser.add_argument("--campaigns", type=int, default=100)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "any_simulator")
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    arguments = parser.parse_args()
    work = arguments.work
    work.mkdir(parents=True, exist_ok=True)
    wanted = arguments.only or [*BESIDE, *OTHERS]
    rows = {
        name: kept(work / f"{name}.json", lambda name=name: beside(name, arguments.data))
        for name in BESIDE
        if name in wanted
    }
    command = f"any_simulator.py --campaigns {arguments.campaigns}"
    command += f" --only {' '.join(arguments.only)}" if arguments.only else ""
    lines = [
        *header("Any simulator", __doc__, command, made_by()),
        *(beside_table(rows) if rows else []),
    ]
    if "slow" in wanted:
        row = kept(work / "slow.json", lambda: slow(work))
        lines += [
            "## A slow function", "",
            f"0.2 s per record: {row['simulations']} simulations and {row['seconds']:.0f} s for the whole job; the "
            f"emulator errs by {row['error']:.2g} nats, and the truth of {row['inside']} of {row['parameters']} "
            "parameters lies in its 90 % interval.", "",
        ]  # fmt: skip
    if "cluster" in wanted:
        row = kept(work / "cluster.json", lambda: cluster(work))
        lines += [
            f"On two Dask workers, one of which {'was' if row['killed'] else 'was not'} killed {KILLED:g} s after the "
            f"beginning: {row['simulations']} simulations, {row['seconds']:.0f} s; estimates and quantiles are "
            f"{'the same to the last digit' if row['same'] else 'NOT the same'}.", "",
        ]  # fmt: skip
    if "calibration" in wanted:
        numbers = range(arguments.campaigns)
        lines += coverage_table([kept(work / f"calibration-{k}.json", lambda k=k: covered(k)) for k in numbers])
    if left_out := [name for name in (*BESIDE, *OTHERS) if name not in wanted]:
        lines += [f"Not run for this page: {', '.join(left_out)}.", ""]
    write_page("any_simulator", lines)


if __name__ == "__main__":
    main()
