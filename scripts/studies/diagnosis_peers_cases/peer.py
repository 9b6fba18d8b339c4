"""One peer on one campaign: JSON on the terminal, predictions of records held out in a file. Runs as a process.

python peer.py PEER FOLDER
"""

from __future__ import annotations

import argparse
import importlib
import json
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from diagnosis_peers_cases.records import load


@dataclass(frozen=True)
class Peer:
    """Where a peer is, the package that it needs, and what its kind of answer holds."""

    title: str
    module: str
    function: str
    where: str
    cause: str
    package: str = ""
    """As it is imported; empty if none is needed."""
    columns: bool = False
    """Whether it uses what single forces and parameters do to the output."""

    @property
    def installed(self) -> bool:
        """Whether its package is there."""
        return not self.package or find_spec(self.package) is not None


PEERS = {
    "pysindy": Peer("SINDy (pysindy)", "by_pysindy", "sindy", "terms", "by its terms", "pysindy", True),
    "sysidentpy": Peer("FROLS (sysidentpy)", "by_sysidentpy", "frols", "terms, lags", "by its terms", "sysidentpy"),
    "gaussian_process": Peer(
        "Gaussian process (scikit-learn)", "by_gaussian_process", "gaussian_process", "signals", "no", "sklearn"
    ),
    "lisdd": Peer("LISDD (after its abstract)", "by_lisdd", "lisdd", "regions", "by its terms", columns=True),
    "independence": Peer("residual and input independent", "by_resid", "independence", "lags", "no"),
    "whiteness": Peer("residual white", "by_resid", "whiteness", "no", "no"),
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("peer", choices=PEERS)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    peer, parts = PEERS[args.peer], load(args.folder / "records.npz")
    module = importlib.import_module(f"diagnosis_peers_cases.{peer.module}")
    said = getattr(module, peer.function)(parts["campaign"], parts["held_out"])
    if said.correction is not None:
        np.save(args.folder / f"{args.peer}.npy", said.correction)
    told = {key: getattr(said, key) for key in ("gap", "terms", "families", "where", "told")}
    print(json.dumps(told | {"corrects": said.correction is not None}))


if __name__ == "__main__":
    main()
