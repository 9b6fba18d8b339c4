"""Which measured records can models of a user's own describe and predict? Writes reports/records/README.md.

    python scripts/studies/records.py [--only NAME ...] [--data FOLDER] [--work FOLDER] [--seed 0]

Two tanks, battery cells, a friction damper, the Silverbox and the positioning system EMPS, measured by others and
read in place. The models are ordinary ones, written as a user writes them (`scripts/studies/records_cases`), in
ranges of one to four decades. Every output is simulated from the initial state and the input alone, never from
measured outputs. Errors of a prediction are those at the best point, and of the mean of 100 draws from the posterior;
its 90 % band is that of the draws together with the residual of the identified tests. The form of the overflow of the
tanks was chosen among some ten with the error on the validation record in view, and so were the ranges of the tanks:
what is predicted there is no blind figure. The law of the cells' resistances is one from the literature, taken after
a polynomial had left 1.2 %; the ranges of the Silverbox lie around the peak of its measured response. Seconds are
those of the processor, on all its cores, with those to compile the model and to write the result; the report is drawn
by a process of its own, which is not counted. The last table has other
programs on the same records and equations, which they integrate by scipy's solve_ivp; they give a best fit and no
posterior.

Rows that the work folder holds already are kept, whatever code made them. pyPESTO and PINTS come with `make bench`;
without them a row says so.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from records_cases import battery, drive, friction, silverbox, tanks
from records_cases.case import Case, run
from records_cases.page import peer_table, section, summary_table
from records_cases.peers import PEERS, PROBLEMS, peer_row
from report_page import ROOT, header, made_with, write_page

CASES = (*tanks.CASES, *battery.CASES, *friction.CASES, *silverbox.CASES, *drive.CASES)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="*", default=[], help="names of cases, or 'peers'; all without it")
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "records")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[Case, dict]] = []
    for case in CASES:
        if not arguments.only or case.name in arguments.only:
            print(case.name, "...", flush=True)
            rows.append((case, run(case, arguments.data, arguments.work, arguments.seed)))
    command = f"records.py --seed {arguments.seed}"
    command += f" --only {' '.join(arguments.only)}" if arguments.only else ""
    lines = [*header("Records of any kind", __doc__, command, made_with()), *summary_table(rows)]
    for case, row in rows:
        lines += section(case, row)
    if not arguments.only or "peers" in arguments.only:
        found = [
            peer_row(peer, problem, arguments.data, arguments.work, arguments.seed)
            for problem in PROBLEMS
            for peer in PEERS
        ]
        lines += peer_table(found, {case.name: row for case, row in rows})
    write_page("records", lines)


if __name__ == "__main__":
    main()
