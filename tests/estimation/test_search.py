"""Records that no search can explain have a status."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import FitError
from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.stages import identify


@pytest.mark.parametrize(
    ("change", "status"),
    [
        (
            lambda p: p.part(0, 4),
            "8 measured joint positions cannot determine 10 unknowns (parameters and start states); "
            "give more frames or fix parameters.",
        ),
        (
            lambda p: replace(p, position=np.where(np.arange(60)[:, None] < 40, p.position[:1], np.nan)),
            "Nothing moves in the record: no joint leaves its noise; give frames with motion.",
        ),
        (
            lambda p: replace(p, position=np.where([True, False], p.position, np.nan)),
            "Joint 'joint2' was measured under 5 times; give more frames.",
        ),
    ],
)
def test_hopeless_records_have_a_status(poses, double, change, status):
    fit = identify(change(poses), double)
    assert not fit.ok
    assert fit.status == status
    with pytest.raises(FitError) as error:
        fit.check()
    assert str(error.value) == status


UNDETERMINED = (
    "The motion does not determine link1.length: the error is as large as the value. A longer record or a "
    "livelier motion would help, or a measured length, given with --fix."
)


@pytest.mark.parametrize("count", range(2, 9))
def test_short_tables_have_a_status(tmp_path, count):
    """Tables of 2 to 8 rows, smooth, rough and with gaps: a sentence, never a traceback."""
    mechanism = load("single")
    for seed in range(4):
        rng = np.random.default_rng(seed)
        # the first seed ends in two samples far off the straight line before them, the second has a gap
        position = (
            np.array([0.0] * max(count - 2, 0) + [0.5, 2.0])
            if seed == 0
            else 0.5 * np.cos(6.0 * np.arange(count) / 30.0) + 10.0 ** -(seed + 1) * rng.normal(size=count)
        )
        cells = [f"{i / 30.0},{x if seed != 1 or i != 1 else ''}" for i, x in enumerate(position)]
        (tmp_path / "log.csv").write_text("\n".join(["time,joint1", *cells]))
        fit = identify(read_poses(tmp_path / "log.csv", mechanism), mechanism, IdentifySettings(starts=1))
        measured = count - (seed == 1)
        if measured <= 5:
            assert fit.status == (
                f"{measured} measured joint positions cannot determine 5 unknowns (parameters and start "
                "states); give more frames or fix parameters."
            )
        elif seed > 0:
            identified = (
                f"Identified from {measured} frames; rms residual "
                f"{np.degrees(fit.rms['joint1']):.3g} deg (joint1)."
            )
            assert fit.status == (identified if fit.parameter("link1.length").identifiable else UNDETERMINED)
            assert 0.3 < fit.parameter("link1.length").value < 1.5
        else:
            # no swing follows a jump of 2 rad: the fit misses it by more than its noise, and says so
            said = (fit.status, *fit.advice)
            assert any(
                s.startswith(("The simulated motion does not follow", "The residual of")) for s in said
            )
        assert fit.ok == fit.status.startswith("Identified")
