"""Records that no search can explain have a status."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import FitError
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting import search
from monodyn.estimation.shooting.problem import posed
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record


@pytest.mark.parametrize(
    ("change", "status"),
    [
        (
            lambda p: p[:4],
            "8 measured joint positions cannot determine 10 unknowns (parameters and start states); "
            "give more frames or fix parameters.",
        ),
        (
            lambda p: replace(p, position=np.where(np.arange(60)[:, None] < 40, p.position[:1], np.nan)),
            "Nothing moves in the record: no joint leaves its noise; give frames with motion.",
        ),
        (
            lambda p: replace(p, position=np.where([True, False], 30.0 * p.position, 0.3)),
            "joint2 never moves, while joint1 does: what is in the record has no such joint, or it is stuck. "
            "Take a mechanism without it, its bodies made one.",
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


def test_optima_that_the_data_cannot_tell_apart_are_listed(monkeypatch):
    """A pendulum of given mass and inertia swings alike about two distances from its centre of mass, whose
    product is inertia over mass (Kater's reversible pendulum)."""
    single = load("single").with_bodies("free")
    radius2 = 4e-4
    held = {"link1.length": 0.2, "link1.mass": 1.0, "link1.inertia": radius2, "link1.com_y": 0.0}
    pendulum = single.with_choices(
        fix={**held, "camera.roll": 0.0}, free=["link1.com_x"], bounds={"link1.com_x": (1e-3, 1.0)}
    ).with_values({"link1.com_x": 0.05})
    times = np.arange(60) / 30.0
    poses = record(pendulum, times, motion(pendulum, times, [0.5], [0.0]), noise=1e-4)
    data, smoothed = prepare((poses,), pendulum), (smooth(ordered(poses, pendulum)),)
    problem = posed(pendulum.with_torque("friction"), data)
    looked = search.Search(problem, smoothed, IdentifySettings(torque="friction"), None)

    def near(x):
        return posed(problem.mechanism.with_values({"link1.com_x": x}), data).unknowns.x0, looked.route

    monkeypatch.setattr(search, "starts", lambda *args: iter([near(0.06), near(0.007)]))
    monkeypatch.setattr(looked, "explained", lambda optimum: False)
    best, _ = looked.from_starts()
    values = [problem.unknowns.named(x)["link1.com_x"] for x in (best.x, *best.twins)]
    np.testing.assert_allclose(sorted(values), [radius2 / 0.05, 0.05], rtol=5e-3)
    # one optimum that two starts lead to is no twin of its own
    monkeypatch.setattr(search, "starts", lambda *args: iter([near(0.06), near(0.045)]))
    assert looked.from_starts()[0].twins == ()


@pytest.mark.slow
def test_what_short_pieces_do_not_follow_is_integrated_as_exactly_as_it_is_followed(truth, double):
    """Driven as no double pendulum swings: 1e-5 rad where radians are missed cost several times the steps."""
    times = np.arange(40) / 30.0
    poses = record(truth, times, np.column_stack([2.0 * np.sin(9.0 * times), 2.5 * np.sin(14.0 * times)]))
    problem = posed(double, prepare([poses], double))
    searched = search.Search(problem, (smooth(poses),), IdentifySettings(starts=1), None)
    given_up, _ = searched.from_starts(give_up=True)
    assert not given_up.complete
    exact, (found, _) = searched.from_start(given_up.x), searched.from_starts()
    assert found.complete
    assert not searched.explained(found)
    # of fourth order 1e4 times the error takes a tenth of the steps, which come in powers of two
    assert 4 * found.trial.substeps <= exact.trial.substeps
