"""Import damaged files of every format: each is refused with one clear message, or makes a valid campaign.

    python scripts/mutate_files.py --files 12000 --seed 0

Sound files of every format, written by the formats' own libraries, are damaged at random: bytes flipped, ends cut off,
blocks doubled, moved, filled or taken from a file of another format, numbers blown up, and first bytes swapped between
formats. For each a map is proposed (`mofit import --guess`), and it is imported with the right map. Allowed are two
outcomes: an `InputError` (exit code 2) with nothing written, or a campaign file that reads back with no fault (and a
proposal that is valid TOML). Failures are any other exception or warning, a file on which mofit's own code took longer
than its limit, a partial file, and a campaign that does not read back. `contained` counts the refusals for which
the process that reads MAT and MDF files had to be ended, by its time limit of 5 s or a crash.
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
from importlib.metadata import version
from pathlib import Path

import numpy as np

from report_header import header, versions

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "campaign"))
import rig_files

from mofit.campaign_file import read_campaign, write_campaign
from mofit.errors import InputError
from mofit.readers import guess_map, import_files
from mofit.readers.contained import Contained

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
            tomllib.loads(guess_map([folder / name], contained))
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
        if not all(fault.what and fault.cure for fault in error.faults):
            return "refused without a cure"
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
    parser.add_argument("--report", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    warnings.simplefilter("error")  # a warning on standard error would be one too many
    signal.signal(signal.SIGALRM, out_of_time)
    counts: dict[str, Counter[str]] = {}
    slowest: dict[str, float] = {}
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as where, Contained(SECONDS) as contained:
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
    lines = table(counts, slowest)
    lines += ["", f"CPU time {cpu:.0f} s; most memory of the reading process"]
    lines[-1] += f" {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB."
    print("\n".join(lines))
    if arguments.report:
        command = f"mutate_files.py --files {arguments.files} --seed {arguments.seed} --report {arguments.report}"
        extra = ", ".join(f"{name} {version(name)}" for name in ("h5py", "asammdf", "pandas"))
        text = "\n".join([*header("Damaged files", __doc__, command), *lines, "", f"{versions()} {extra}.", ""])
        arguments.report.parent.mkdir(parents=True, exist_ok=True)
        arguments.report.write_text(text)


def table(counts: dict[str, Counter[str]], slowest: dict[str, float]) -> list[str]:
    """Markdown rows per format and their sum."""
    lines = ["| format | files | imported | refused | contained | failures | slowest, s |", "|---|" + "---:|" * 6]
    for format, count in [*counts.items(), ("all", sum(counts.values(), Counter()))]:
        good = [count[key] for key in ("imported", "refused", "contained")]
        row = [format, count.total(), sum(good[:1]), good[1] + good[2], good[2], count.total() - sum(good)]
        worst = slowest.get(format, max(slowest.values(), default=0.0))
        lines.append(f"| {' | '.join(map(str, row))} | {worst:.2f} |")
    return lines


if __name__ == "__main__":
    main()
