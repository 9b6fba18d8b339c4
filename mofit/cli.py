"""The command line: parse, call one function, print."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from mofit import __version__
from mofit.errors import InputError

DONE, UNUSABLE, NOT_CONVERGED, NOT_IDENTIFIABLE = 0, 2, 3, 4
INTERRUPTED = 130

app = App(
    name="mofit",
    version=__version__,
    help="Identify dynamic models from test-bench data, with every plausible solution and an honest spread.",
    help_format="rich",
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative="", show_default=lambda value: value not in (False, ())),
)

Json = Annotated[bool, Parameter(name="--json", help="Print one JSON object on standard output.")]
Jobs = Annotated[int | None, Parameter(help="Threads; results do not depend on it. All cores by default.")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (see the README)."""
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        return code if isinstance(code, int) else DONE
    except InputError as error:
        _say(f"mofit: {error}")
        return UNUSABLE
    except CycloptsError as error:
        _say(f"mofit: {error}".rstrip() + " See mofit --help.")
        return UNUSABLE
    except KeyboardInterrupt:
        _say("mofit: interrupted; nothing is damaged. The same command with --resume goes on.")
        return INTERRUPTED
    except BrokenPipeError:
        return DONE


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def _print_json(data: Any) -> None:
    print(json.dumps(data, allow_nan=False))


@app.command
def check(file: Path, /, *, as_json: Json = False) -> int:
    """Read a campaign and say all that is wrong or odd with it.

    Example: mofit check my_campaign.nc

    Parameters
    ----------
    file
        Campaign file (netCDF, mofit.campaign/1).
    """
    from dataclasses import asdict

    from mofit.check import check_campaign

    faults = check_campaign(file)
    if as_json:
        _print_json({"faults": [asdict(fault) for fault in faults]})
    else:
        for fault in faults:
            print(f"{fault.severity}: {fault}")
        print(f"{file}: {len(faults)} finding(s)" if faults else f"{file}: nothing wrong found")
    return UNUSABLE if any(fault.severity == "error" for fault in faults) else DONE


@app.command
def identify(
    file: Path | None = None,
    /,
    *,
    all_freqs: bool = False,
    freq: tuple[float, ...] = (),
    test: tuple[str, ...] = (),
    model: str | None = None,
    effect: tuple[str, ...] = (),
    search: str = "niching",
    weights: tuple[str, ...] = (),
    bounds: tuple[str, ...] = (),
    fix: tuple[str, ...] = (),
    joint: bool = False,
    seed: int = 0,
    out: Path | None = None,
    resume: bool = False,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Identify a model's parameters: every plausible solution, its exact minimum and its spread.

    Example: mofit identify my_campaign.nc --all-freqs --model maxwell_tyre --seed 1

    Parameters
    ----------
    file
        Campaign file; without one the bundled (simulated) campaign is taken.
    all_freqs
        Use all tests of the model's kinds; the default unless --freq is given.
    freq
        Use only the tests of this frequency in Hz, as on their label; repeatable.
    test
        Use only the test of this name; repeatable.
    model
        Name of a shipped model, or path/to/file.py:Name. Found from the channels if left out.
    effect
        Effect to add to the model: a shipped name, or path/to/file.py:Name; repeatable.
    search
        niching (the default), paper (the firefly algorithm exactly as published) or surrogate (for expensive models).
    weights
        Weight of a test in the search, TEST=NUMBER; repeatable.
    bounds
        Other bounds for a parameter, NAME=LOWER:UPPER in SI units; repeatable.
    fix
        Hold a parameter, NAME=VALUE in SI units; repeatable.
    joint
        Identify calibration and dynamic parameters at once.
    seed
        Seed of every random draw.
    out
        Folder of the run; by default the next free one under runs/.
    resume
        Go on with an interrupted run.
    """
    from mofit.job import Job, identify_file
    from mofit.options import by_name, range_by_name
    from mofit.settings import Settings
    from mofit.terminal import progress_bar

    if all_freqs and (freq or test):
        raise InputError.of("--all-freqs", "given together with --freq or --test", "Leave one of them out")
    settings = Settings(
        search=search,
        weights=by_name("--weights", weights),
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        joint=joint,
        seed=seed,
        jobs=jobs or os.cpu_count() or 1,
    )
    job = Job(file, model, effect, freq, test, settings, out, resume)
    with progress_bar() as progress:
        folder, summary = identify_file(job, progress)
    if as_json:
        _print_json(summary)
    else:
        from mofit.terminal import show_identification

        show_identification(summary, folder)
    return DONE if summary["converged"] else NOT_CONVERGED


@app.command
def simulate(plan: Path, /, *, out: Path | None = None, as_json: Json = False) -> int:
    """A virtual test rig: make a campaign from a model, effects and noise.

    Example: mofit simulate data/plans/table5.toml --out table5.nc

    Parameters
    ----------
    plan
        Plan file (TOML).
    out
        Campaign file to write; by default the plan's name with .nc.
    """
    from mofit.campaign_file import write_campaign
    from mofit.simulate import simulate as run

    target = _new_file(out or Path(plan.with_suffix(".nc").name))
    campaign = run(plan)
    write_campaign(campaign, target)
    return _report_campaign(campaign, target, as_json)


@app.command(name="import")
def import_(
    *sources: Path,
    map: Path,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Turn measured files (CSV, text, MAT) into a campaign, as a map file says.

    Example: mofit import measured/*.csv --map my_rig.toml --out campaign.nc

    Parameters
    ----------
    sources
        Files or folders in which the map's files are looked for.
    map
        Map file (TOML): which column is which channel, in which unit; see docs/campaigns.md.
    out
        Campaign file to write; by default the map's name with .nc.
    """
    from mofit.campaign_file import write_campaign
    from mofit.readers import import_files

    target = _new_file(out or Path(map.with_suffix(".nc").name))
    campaign = import_files(sources, map)
    write_campaign(campaign, target)
    return _report_campaign(campaign, target, as_json)


def _new_file(target: Path) -> Path:
    if target.exists():
        raise InputError.of(str(target), "exists already", "Name another with --out, or remove it")
    if not target.parent.is_dir():
        raise InputError.of(str(target), "its folder does not exist", "Make the folder first")
    return target


def _report_campaign(campaign: Any, target: Path, as_json: bool) -> int:
    rows = [
        {"test": m.name, "procedure": m.kind, "samples": len(m.time), "seconds": float(m.time[-1] - m.time[0])}
        for m in campaign.measurements
    ]
    if as_json:
        _print_json({"file": str(target), "source": campaign.source, "tests": rows})
    else:
        print(f"{target}: {campaign.title} ({campaign.source}), {len(rows)} tests")
        for row in rows:
            print(f"  {row['test']}: {row['procedure']}, {row['samples']} samples, {row['seconds']:.3g} s")
    return DONE


@app.command
def report(run: Path, /, *, as_json: Json = False) -> int:
    """Build the HTML report of a run anew.

    Example: mofit report runs/my-campaign-maxwell_tyre

    Parameters
    ----------
    run
        Folder of a finished run.
    """
    from mofit.report import build_report

    page = build_report(run)
    if as_json:
        _print_json({"report": str(page)})
    else:
        print(page)
    return DONE


@app.command
def uncertainty(run: Path, /, *, parameter: tuple[str, ...] = (), as_json: Json = False) -> int:
    """Build the uncertainty page of a run: intervals, flat directions, predictive bands, agreement of the tests.

    Example: mofit uncertainty runs/my-campaign-maxwell_tyre --parameter d_M

    Parameters
    ----------
    run
        Folder of a finished run.
    parameter
        Ask for this parameter: exit code 4 if the data do not identify it; repeatable.
    """
    from mofit.report import build_uncertainty, spread_table
    from mofit.result import open_result

    tree = open_result(run)
    table = spread_table(tree, parameter)
    page = build_uncertainty(run, tree)
    if as_json:
        _print_json({"uncertainty": str(page), **table})
    else:
        print(page)
    if not table["converged"]:
        return NOT_CONVERGED
    return NOT_IDENTIFIABLE if table["not_identifiable"] else DONE


@app.command
def bench(
    name: str,
    /,
    *,
    runs: int | None = None,
    seed: int | None = None,
    jobs: Jobs = None,
    report: Path | None = None,
    as_json: Json = False,
) -> int:
    """Run a shipped benchmark; all competitors in one run.

    Example: mofit bench rastrigin --runs 1000 --report reports/rastrigin

    Parameters
    ----------
    name
        kernel, rastrigin, cec2013 or front.
    runs
        Runs of each competitor; slow ones may do fewer, which the table tells.
    seed
        Of all runs.
    report
        Folder to write the table into, as README.md, with the benchmark's figures.
    """
    from mofit.bench import run_benchmark
    from mofit.bench.page import write_page
    from mofit.terminal import show_table

    result = run_benchmark(name, runs=runs, seed=seed, jobs=jobs)
    if report is not None:
        write_page(name, result, report)
    if as_json:
        _print_json(result)
    else:
        show_table(result["rows"], result["settings"])
    return DONE


if __name__ == "__main__":
    sys.exit(main())
