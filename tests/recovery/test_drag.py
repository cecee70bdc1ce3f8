"""Quadratic drag, which nobody asks for by default, found in a simulated record."""

from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.unknowns import assumed_sizes
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import TIMES, motion, record, sigmas


def test_drag_that_is_freed_is_found() -> None:
    single = load("single")
    # a drag is in proportion to the inertia: every size that counts in it is given
    sizes = {p.name: p.value for p in (*assumed_sizes(single), single.parameter("link1.thickness"))}
    single = single.with_choices(fix={**sizes, "link1.length": 0.2})
    truth = single.with_values({"joint1.drag": 2e-4, "joint1.damping": 5e-4})
    poses = record(truth, TIMES, motion(truth, TIMES, [1.2], [3.0]))
    fit = identify(poses, single.with_choices(free=["joint1.drag"]))
    assert fit.ok, fit.status
    drag = fit.parameter("joint1.drag")
    assert drag.identifiable
    assert sigmas(drag, 2e-4) < 4.0  # four standard deviations, one seed
    assert drag.std < 0.5e-4
    without = identify(poses, single, IdentifySettings(torque="friction"))
    assert without.parameter("joint1.drag").value == 0.0
    assert without.rms["joint1"] > fit.rms["joint1"]
    # the evidence alone leads there as well
    found = identify(poses, single)
    assert found.acting == fit.acting
    assert sigmas(found.parameter("joint1.drag"), 2e-4) < 4.0
