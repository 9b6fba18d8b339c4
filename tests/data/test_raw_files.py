"""Raw files of others import with a proposed map and at most three edited lines (scripts/studies/imports.py)."""

from pathlib import Path

import numpy as np
import pytest

from imports import NO_RECORD, data_files, imported
from mofit.data import propose_map
from mofit.errors import InputError

DATA = Path(__file__).parents[3] / "shared" / "data"
FILES = data_files(DATA)

pytestmark = pytest.mark.skipif(not FILES, reason="the measured data (../shared/data) are not here")


@pytest.mark.parametrize("folder", sorted({path.parent.name for path in FILES}) or ["none"])
def test_raw_files_import_with_at_most_three_edited_lines(folder, tmp_path):
    for path in (path for path in FILES if path.parent.name == folder):
        if path.name in NO_RECORD:
            with pytest.raises(InputError, match="no input and output found"):
                propose_map([path])
            continue
        campaign, edited = imported(path, tmp_path)
        assert edited <= 3
        assert len(campaign.measurements) >= 1
        for test in campaign.measurements:
            assert len(test.experiment.inputs) == 1
            assert len(test.outputs) == 1


def test_the_damper_without_a_header_needs_no_edit(tmp_path):
    paths = [path for path in FILES if path.parent.name == "mr_damper_sine"][:2]
    for path in paths:
        campaign, edited = imported(path, tmp_path)
        (test,) = campaign.measurements
        assert edited == 0
        assert (list(test.experiment.inputs), list(test.outputs)) == (["displacement"], ["force"])
        assert np.ptp(test.channel("displacement")) == pytest.approx(0.0195, abs=0.002)  # 9.73 mm: SOURCE.txt
