"""Is a green banner ever wrong? Sixty made-up systems with models of their own. Writes reports/robustness/systems.md.

    python scripts/studies/sixty_systems.py [--seed 0] [--parallel 1] [--limit 60] [--only NAME ...]
                                            [--option ARGUMENT] [--work FOLDER] [--page FILE]

Lags, RC circuits, tanks, thermal masses, motors, oscillators, friction, pendulums and Zener elements, with 2 to 8
parameters and sizes over more than 12 decades. The truth is simulated by scipy, without code of mofit; the noise is
white, 0.3 to 3 % of the range. Each system has a model file as a user writes it. Twenty models are right. Twenty lack
something that the data show: it is made stronger until the model misses by the noise. Twenty have a ridge:
parameters that act only together, or one that the tests do not touch. In one of six, a box does not hold the truth.

`mofit identify` has 60 s of one processor for each; `--limit` is the wall time after which it is ended, and may be
longer where others use the machine. It is wrong if it is green (exit code 0, no warning) and calls a parameter
identified whose true value is outside of the 99.9 % interval or which the data do not determine, or if the model is
wrong. The misfit is that of the wrong model's best fit; the expected spread comes from the linearised truth. Rows that
the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import mofit
from report_page import ROOT
from systems.design import cases
from systems.page import page
from systems.running import LIMIT, run


def code_digest(options: list[str]) -> str:
    """Digest of mofit, of this study and of the options: rows of another code are not kept."""
    digest = hashlib.sha256(json.dumps(options).encode())
    for folder in (Path(mofit.__file__).parent, Path(__file__).parent / "systems"):
        for file in sorted(folder.rglob("*.py")):
            if file.name not in ("page.py", "report_page.py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def kept_rows(path: Path) -> dict[str, dict]:
    """Rows by name; an incomplete last line is none."""
    if not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return {row["name"]: row for row in (json.loads(line) for line in lines if line.endswith("\n"))}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parallel", type=int, default=1, help="systems at a time")
    parser.add_argument("--only", nargs="*", default=[], help="names of systems; all without it")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "sixty_systems")
    parser.add_argument("--page", type=Path, default=ROOT / "reports" / "robustness" / "systems.md")
    parser.add_argument("--option", action="append", default=[], help="one more argument of mofit identify; repeatable")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of wall time; longer on a busy machine")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    path = arguments.work / f"rows-{arguments.seed}-{code_digest([*arguments.option, f'{arguments.limit:g}'])}.jsonl"
    rows = kept_rows(path)
    wanted = [case for case in cases() if not arguments.only or case.name in arguments.only]

    def one(case) -> dict:
        return run(case, arguments.seed, arguments.work, tuple(arguments.option), arguments.limit)

    with ThreadPoolExecutor(arguments.parallel) as pool:
        for task in as_completed([pool.submit(one, case) for case in wanted if case.name not in rows]):
            row = task.result()
            rows[row["name"]] = row
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(
                row["name"], row["code"], f"{row['seconds']} s", "WRONG" if row["green_but_wrong"] else "", flush=True
            )
    given = [f"--option={option}" for option in arguments.option]
    command = " ".join(["sixty_systems.py", f"--seed {arguments.seed}", f"--limit {arguments.limit:g}", *given])
    text = "\n".join(page([rows[case.name] for case in wanted], command, __doc__)).rstrip() + "\n"
    arguments.page.parent.mkdir(parents=True, exist_ok=True)
    arguments.page.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
