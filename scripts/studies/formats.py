"""What happens to damaged files of every format? Writes reports/formats/README.md.

    python scripts/studies/formats.py [--files 12000] [--seed 0]

Valid files of every format, written by the formats' own libraries, are damaged at random: bytes flipped, ends cut
off, blocks doubled, moved, filled or taken from a file of another format, numbers made huge, and first bytes swapped
between formats. For each file `mofit import --guess` proposes a map, and the right map imports it. Two outcomes are
allowed: an `InputError` (exit code 2) with nothing written, or a campaign file that reads back without an issue (and
a proposal that is valid TOML). Failures are any other exception or warning, a file on which mofit's own code took
longer than its limit, a partial file, and a campaign that does not read back. `contained` counts the refusals for
which the process that reads files through a library had to be ended, by its time limit of 5 s or a crash.
"""

from __future__ import annotations

import argparse
import gzip
import resource
import signal
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from report_page import ROOT, header, made_with, table, write_page

sys.path.insert(0, str(ROOT / "tests" / "support"))
import rig_files

from mofit.data import import_files, propose_map, read_campaign, write_campaign
from mofit.data.importers.contained import Contained, ContainedLimits
from mofit.errors import InputError

#: wall time in s that the reading process, and any file at all, may take
SECONDS, LIMIT = 5, 60


def sound_files(folder: Path) -> dict[str, tuple[str, bytes, str]]:
    """Name of the file, its bytes and its map, by format."""
    found = {}
    for format in rig_files.WRITERS:
        path = rig_files.write(folder, format)
        found[format] = (path.name, path.read_bytes(), rig_files.map_of(path, format))
    name, content, text = found["csv"]
    found["csv.gz"] = (f"{name}.gz", gzip.compress(content, mtime=0), text.replace(name, f"{name}.gz"))
    rig_files.write_mdf(folder / "plain.mf4", rig_files.record(), compression=0)
    text = found["mf4"][2].replace("run.mf4", "plain.mf4")
    found["mf4, plain"] = ("plain.mf4", (folder / "plain.mf4").read_bytes(), text)
    rig_files.write_mdf(folder / "old.mdf", rig_files.record(), version="3.30", compression=0)
    found["mdf 3"] = ("old.mdf", (folder / "old.mdf").read_bytes(), text.replace("plain.mf4", "old.mdf"))
    rig_files.write_mat5(folder / "plain.mat", rig_files.record(), do_compression=False)
    text = found["mat"][2].replace("run.mat", "plain.mat")
    found["mat, plain"] = ("plain.mat", (folder / "plain.mat").read_bytes(), text)
    return found


def damaged(content: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """The content with one to three damages."""
    for _ in range(rng.integers(1, 4)):
        data = bytearray(content)
        size = len(data)
        # headers decide what is read: half of the damage goes there
        at = int(rng.integers(min(size, 512))) if rng.random() < 0.5 else int(rng.integers(size))
        length = int(rng.integers(1, max(2, min(size, 2000))))
        match rng.integers(9):
            case 0:
                for place in rng.integers(size, size=rng.integers(1, 20)):
                    data[place] ^= 1 << int(rng.integers(8))
            case 1:
                data[at] = int(rng.integers(256))
            case 2:
                del data[int(rng.integers(1, size)) :]
            case 3:
                data[at:at] = data[at : at + length]
            case 4:
                to = int(rng.integers(size))
                data[to : to + length] = data[at : at + length]
            case 5:
                data[at : at + length] = bytes([int(rng.choice([0, 255, 32, 57]))]) * length
            case 6:
                other = others[rng.integers(len(others))]
                data[at : at + length] = other[at % len(other) :][:length]
            case 7:
                at -= at % 8
                data[at : at + 8] = int(rng.choice([2**63 - 1, 2**31, 2**24, 1, at])).to_bytes(8, "little")
            case _:
                other = others[rng.integers(len(others))]
                keep = int(rng.choice([8, 64, 128, 512]))
                data[:keep] = other[:keep]
        content = bytes(data) or b"\0"
    return content


def outcome(folder: Path, name: str, contained: Contained) -> str:
    """``imported``, ``refused``, ``contained``, or what went wrong."""
    target = folder / "out.nc"
    before = {path.name for path in folder.iterdir()}
    try:
        try:
            tomllib.loads(propose_map([folder / name], contained))
        except InputError as error:
            if "crashed, or took" in str(error):
                return "contained"
        write_campaign(import_files([folder / name], folder / "map.toml", contained), target)
        found = "imported"
        read_campaign(target)
    except InputError as error:
        if target.exists():
            return "imported, but does not read back"
        found = "contained" if "crashed, or took" in str(error) else "refused"
        if not all(issue.message and issue.hint for issue in error.issues):
            return "refused without a hint"
    except BaseException as error:  # noqa: BLE001  every one is a finding
        traceback.print_exc()
        return f"{type(error).__name__}"
    target.unlink(missing_ok=True)
    return found if {path.name for path in folder.iterdir()} == before else "partial file"


def out_of_time(*_: object) -> None:
    """What the alarm does to mofit's own code."""
    raise TimeoutError(f"longer than {LIMIT} s")


def main() -> None:
    """Run, print and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--files", type=int, default=12000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="this format alone")
    parser.add_argument("--keep", type=Path, help="folder for the files that failed")
    arguments = parser.parse_args()
    warnings.simplefilter("error")  # a warning on standard error would be one too many
    signal.signal(signal.SIGALRM, out_of_time)
    counts: dict[str, Counter[str]] = {}
    slowest: dict[str, float] = {}
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as where, Contained(ContainedLimits(seconds=SECONDS)) as contained:
        (root := Path(where) / "sound").mkdir()
        sound = sound_files(root)
        for k in range(arguments.files):
            format = list(sound)[k % len(sound)]
            if arguments.only not in (None, format):
                continue
            name, content, text = sound[format]
            rng = np.random.default_rng([arguments.seed, k])
            (folder := Path(where) / "try").mkdir(exist_ok=True)
            (folder / name).write_bytes(damaged(content, [other for _, other, _ in sound.values()], rng))
            (folder / "map.toml").write_text(text)
            start = time.perf_counter()
            signal.alarm(LIMIT)
            found = outcome(folder, name, contained)
            signal.alarm(0)
            slowest[format] = max(slowest.get(format, 0.0), time.perf_counter() - start)
            counts.setdefault(format, Counter())[found] += 1
            if found not in ("imported", "refused", "contained"):
                print(f"{format} {k}: {found}", flush=True)
                if arguments.keep:
                    (arguments.keep / f"{k}-{name}").write_bytes((folder / name).read_bytes())
            for path in folder.iterdir():
                path.unlink()
    cpu = time.process_time() - begun + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    command = f"formats.py --files {arguments.files} --seed {arguments.seed}"
    used = f"CPU time {cpu:.0f} s; most memory of the reading process {memory:.0f} MB."
    foot = [used, "", made_with("h5py", "asammdf", "openpyxl", "pandas", "pyarrow")]
    write_page("formats", [*header("Damaged files", __doc__, command), *outcomes(counts, slowest), *foot])


def outcomes(counts: dict[str, Counter[str]], slowest: dict[str, float]) -> list[str]:
    """Markdown rows per format and their sum."""
    rows = []
    for format, count in [*counts.items(), ("all", sum(counts.values(), Counter()))]:
        good = [count[key] for key in ("imported", "refused", "contained")]
        worst = slowest.get(format, max(slowest.values(), default=0.0))
        failures = count.total() - sum(good)
        rows.append((format, count.total(), good[0], good[1] + good[2], good[2], failures, f"{worst:.2f}"))
    return table(("format", "files", "imported", "refused", "contained", "failures", "slowest, s"), rows)


if __name__ == "__main__":
    main()
