"""From a run folder to a controller: its files hold what a client needs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import av
import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import binom

from controllable import STARTS, TIMES, TRUE, identified
from monodyn.errors import SettingsError
from monodyn.estimation.record.tables import write_poses
from monodyn.mechanism import load
from monodyn.pipeline import identify_tables
from monodyn.results import controlled as controlled_module
from monodyn.results.caveats import draws_said, undrawn
from monodyn.results.controlled import Aim, control, control_run
from monodyn.results.loop_film import camera_for
from monodyn.results.regulator import Allowed
from monodyn.results.sight import outlines_of
from support import command, refuses
from swings import motion, record

UP = {"joint1": 1.57}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of a cart-pole."""
    folder = tmp_path_factory.mktemp("cart")
    true = load("cartpole").with_values(TRUE["cartpole"])
    position = motion(true, TIMES, STARTS["cartpole"], (0.0, 0.0), steps=32)
    write_poses(record(true, TIMES, position), folder / "poses.csv")
    identify_tables([folder / "poses.csv"], "cartpole", folder / "run")
    return folder / "run"


@pytest.mark.slow
def test_a_client_balances_the_model_with_the_numbers_of_the_files(run: Path, tmp_path: Path) -> None:
    done = command(
        "control", run, "--at", "joint1=1.57", "--actuated", "slide", "--out", tmp_path / "c", "--quiet"
    )
    assert (done.code, done.out, done.err) == (0, "", "")
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == [
        "control.html", "control.json", "control.mp4", "model.xml", "run.toml",
    ]  # fmt: skip
    document = json.loads((tmp_path / "c" / "control.json").read_text())
    body = mujoco.MjModel.from_xml_path(str(tmp_path / "c" / "model.xml"))
    data = mujoco.MjData(body)
    names = list(document["operating_point"]["position"])
    assert [body.joint(i).name for i in range(2)] == names == ["slide", "joint1"]
    at = np.array([*document["operating_point"]["position"].values(), 0.0, 0.0])
    gain, each = np.array(document["gain"]), round(1.0 / document["rate"] / body.opt.timestep)
    mujoco.mj_resetDataKeyframe(body, data, 0)
    assert data.qpos == pytest.approx(at[:2] + np.array([0.0, 0.2]), abs=1e-12)
    loop = document["closed_loop"]
    for row in range(len(loop["time"])):
        measured = [loop["position"][name][row] for name in names]
        np.testing.assert_allclose(data.qpos, measured, atol=1e-9)
        torque = document["operating_point"]["torque"]["slide"] - gain @ (np.r_[data.qpos, data.qvel] - at)
        data.actuator("slide_torque").ctrl = torque
        assert torque[0] == pytest.approx(loop["torque"]["slide"][row], abs=1e-7)
        mujoco.mj_step(body, data, each)
    assert loop["balanced"] is True
    assert len(loop["time"]) == 2001
    with av.open(str(tmp_path / "c" / "control.mp4")) as film:
        pictures = [frame.to_ndarray(format="gray") for frame in film.decode(video=0)]
    assert len(pictures) == len(loop["time"][::7])
    # the mechanism is dark lines on light paper
    assert pictures[0].shape == (480, 720)
    assert 0.001 < np.mean(pictures[0] < 128) < 0.1
    page = (tmp_path / "c" / "control.html").read_text(encoding="utf-8")
    assert "<h1>cartpole balanced by slide</h1>" in page
    assert "Controller of the mechanism that was identified in 'run'." in unescape(page)
    assert "<strong>In MuJoCo the identified mechanism stays balanced.</strong>" in page
    assert "<b>50 of 50</b><span>draws of what the data allow held</span>" in page
    assert "<dt>equilibrium</dt><dd>slide 0 mm, joint1 90 deg</dd>" in page
    assert "<dt>from</dt><dd>slide 0 mm, joint1 101.5 deg</dd>" in page
    gains = [f"{x:.5g}".replace("-", "−") for x in document["gain"][0]]
    assert re.findall(r"<td[^>]*>([^<]*)</td>", page) == ["slide", *gains]
    back = re.search(r'<a href="([^"]*)">The report of the run', page)[1]
    assert (tmp_path / "c" / back).resolve() == (run / "report.html").resolve()
    assert '<a href="control.mp4">' in page
    assert (
        "In N m and N, by rad, m, rad/s and m/s. The law is in control.json; in model.xml each of these "
        "joints has a motor, whose control is the torque."
    ) in page
    said = " ".join((tmp_path / "c" / "model.xml").read_text().split())
    assert (
        said.count("Only ratios show: masses, inertias, frictions, springs and torques are known up to") == 1
    )
    assert (
        "Keyframe start is where the closed loop of control.json begins, equilibrium where it is to "
        "stay. Controls of slide_torque are the torques of its law."
    ) in said
    assert body.key("equilibrium").qpos == pytest.approx(at[:2], abs=1e-12)
    torque = json.loads(re.search(r"const PLOTS = (.*);", page)[1])[-1]
    assert (torque["title"], torque["unit"]) == ("torque at slide", "N")
    np.testing.assert_allclose(torque["fitted"]["value"], loop["torque"]["slide"], rtol=1e-5, atol=1e-9)


@pytest.mark.slow
def test_a_swing_is_in_the_document_and_the_notes(run: Path, tmp_path: Path) -> None:
    aim = Aim(UP, ["slide"], swing=True, draws=4)
    found = control_run(run, tmp_path / "swing", aim, film=False)
    assert found.ok
    assert found.swing is not None
    assert not (tmp_path / "swing" / "control.mp4").exists()
    document = json.loads((tmp_path / "swing" / "control.json").read_text())
    swing = document["swing"]
    assert len(swing["time"]) == len(swing["state"]["joint1_vel"]) == len(swing["gain"]) + 1
    assert swing["state"]["joint1"][0] == pytest.approx(-np.pi / 2.0, abs=1e-6)
    assert len(document["closed_loop"]["time"]) == round((swing["seconds"] + 10.0) * 200) + 1
    stability = found.regulator.stability
    assert swing["state"]["joint1"][-1] == pytest.approx(np.pi / 2.0)
    scales = f"{stability.lightest:.2g} to {stability.heaviest:.2g}"
    assert found.notes[:6] == (
        f"The gains hold 4 of 4 mechanisms that the data allow; the slowest pole of any is at "
        f"{stability.worst:.3g} 1/s.",
        "That all of 4 are held says little: up to 53 % of those that the data allow may not be (95 % sure); "
        "20 draws or more say it better.",
        f"The linear system stays balanced with {scales} times the masses.",
        f"The swing takes {swing['seconds']:.3g} s and reaches the balance with {swing['reached']} of "
        f"{swing['draws']} mechanisms that the data allow.",
        "A swing depends on the scale of the masses, which the record leaves open: where the mechanism has k "
        "times those of model.xml, all its torques have to be k times as large (closed_loop has factor= for "
        "it).",
        "In MuJoCo the identified mechanism stays balanced.",
    )
    said = (
        f"out '{tmp_path / 'swing'}': expected a folder without a controller, it holds control.json; give "
        "another folder, or --force to replace the controller."
    )
    with refuses(SettingsError, said):
        control_run(run, tmp_path / "swing", aim)


def literally(document: dict, path: Path) -> np.ndarray:
    """Return where the law of a document, taken by its words, has brought the model of a file in the end."""
    body = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(body)
    mujoco.mj_resetDataKeyframe(body, data, 0)
    joints, motors, swing = document["states"][: body.njnt], document["motors"], document["swing"]
    at = np.array([*(document["operating_point"]["position"][name] for name in joints), *np.zeros(body.njnt)])
    held = np.array([document["operating_point"]["torque"][name] for name in motors])
    way = np.array([swing["state"][name] for name in document["states"]]).T
    torques = np.array([swing["torque"][name] for name in motors]).T
    most = np.array([swing["limit"][name] for name in motors])
    for k in range(round((swing["seconds"] + 4.0) * document["rate"])):
        state = np.concatenate((data.qpos, data.qvel))
        if k < len(torques):
            torque = torques[k] - np.array(swing["gain"][k]) @ (state - way[k])
        else:
            torque = held - np.array(document["gain"]) @ (state - at)
        for motor, one in zip(motors, np.clip(torque, -most, most), strict=True):
            data.actuator(f"{motor}_torque").ctrl = one
        mujoco.mj_step(body, data, round(1.0 / document["rate"] / body.opt.timestep))
    return data.qpos - at[: body.njnt]


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 2.0 * np.pi, -2.0 * np.pi])
def test_the_law_of_a_swing_holds_by_its_words(run: Path, tmp_path: Path, turn: float) -> None:
    """Whatever turn the equilibrium is asked for on: the law has no whole turns to take off."""
    aim = Aim({"joint1": np.pi / 2.0 + turn}, ["slide"], swing=True, draws=0)
    found = control_run(run, tmp_path / "up", aim, film=False)
    assert found.ok
    document = json.loads((tmp_path / "up" / "control.json").read_text())
    ends = [document["swing"]["state"][name][-1] for name in ("slide", "joint1")]
    assert list(document["operating_point"]["position"].values()) == pytest.approx(ends, abs=1e-2)
    # hanging at -pi/2 both ways are as short: the one is taken on which the pole ends where it was asked for
    there = np.pi / 2.0 if turn >= 0.0 else -1.5 * np.pi
    assert ends[1] == pytest.approx(there, abs=1e-2)
    said = (
        "The swing reaches the equilibrium on another turn: counted on from its start, as control.json has "
        f"it, it is at joint1={found.held[1]:.6g}."
    )
    assert (said in found.notes) == (turn > 0.0)
    assert document["turning"] == ["joint1"]
    assert document["law"].endswith(
        "each torque is clipped to plus or minus its limit of the swing, then, too"
    )
    assert np.abs(literally(document, tmp_path / "up" / "model.xml")).max() < 1e-3


@pytest.mark.slow
def test_a_doubtful_fit_and_one_that_falls_say_so() -> None:
    _, fit = identified("cartpole")
    far = control(fit, Aim(UP, ["slide"], start={"joint1": -1.5}, draws=0))
    assert not far.ok
    assert far.loop.position[0] == pytest.approx([0.0, -1.5], abs=1e-9)
    assert "In MuJoCo the identified mechanism does not stay balanced." in far.notes
    assert far.notes[0] == (
        "No mechanisms were drawn: the gains were tried on the identified mechanism alone."
    )
    doubted = replace(far, fit=fit.doubted([refusal()]))
    assert doubted.notes[0] == "The mechanism is not to be relied on: It is wrong."
    balanced = replace(doubted, loop=replace(far.loop, balanced=True))
    page = controlled_module._page(balanced, Path("run"))
    assert (page.status, page.grade) == (doubted.notes[0], "refused")
    assert "In MuJoCo the identified mechanism stays balanced." in page.notes
    assert page.status not in page.notes


def test_why_there_are_no_draws_is_said() -> None:
    """A fit that leaves its parameters open has no draws, which is not that none of them were held."""
    _, fit = identified("cartpole")
    unknown = replace(fit, covariance=np.full_like(fit.covariance, np.nan))
    found = control(unknown, Aim(UP, ["slide"]))
    assert found.notes[0] == (
        "None of the 50 mechanisms were drawn, as the fit does not say how well its parameters are known: "
        "the gains were tried on the identified mechanism alone."
    )
    page = controlled_module._page(found, Path("run"))
    assert ("0 of 50", "mechanisms that the data allow drawn") in page.facts
    given = replace(fit, parameters=tuple(replace(p, free=False) for p in fit.parameters))
    assert undrawn(given, 7) == (
        "None of the 7 mechanisms were drawn, as nothing of the mechanism was estimated"
    )
    assert undrawn(fit, 7) == (
        "None of the 7 mechanisms were drawn, as what the data allow reaches beyond the bounds of the "
        "parameters"
    )


def test_a_film_that_is_interrupted_leaves_nothing(run: Path, tmp_path: Path, monkeypatch) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(controlled_module, "write_loop", stopped)
    with pytest.raises(KeyboardInterrupt):
        control_run(run, tmp_path / "none", Aim(UP, ["slide"], draws=0))
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_a_rate_at_which_it_falls_in_between_is_named() -> None:
    """At one measurement a second a cart-pole is lost between two, whatever the data say of it."""
    _, fit = identified("cartpole")
    slow = control(fit, Aim(UP, ["slide"], rate=1.0, draws=6))
    pole = max(np.linalg.eigvals(slow.regulator.linear.system.A).real)
    said = (
        f"From one measurement to the next, 1 s, it falls {np.exp(pole):.2g} times as far from the "
        "equilibrium as it was, which leaves no room for any error of the model: measure more often "
        "with --rate."
    )
    assert said in slow.notes
    assert not any("data do not tell" in note for note in slow.notes)
    assert not any("1 to 1 times the masses" in note for note in slow.notes)
    assert not any("measure more often" in note for note in control(fit, Aim(UP, ["slide"], draws=0)).notes)


def test_draws_that_were_not_found_are_counted() -> None:
    _, fit = identified("cartpole")
    found = control(fit, Aim(UP, ["slide"], draws=3))
    asked = replace(found, aim=replace(found.aim, draws=50))
    said = (
        "Of 50 mechanisms 47 were not found: what the data allow reaches beyond the bounds of the parameters."
    )
    assert said in asked.notes
    assert said not in found.notes


def test_what_it_means_that_draws_fall() -> None:
    """The limit against a search: with that share it is just one case in twenty that so few fall."""
    assert draws_said(20, 20) == draws_said(0, 0) == []
    (said,) = draws_said(45, 50)
    assert said == (
        "The true mechanism is one that it does not hold with a chance of up to 20 % (95 % sure): film what "
        "the report of the run advises, or weigh the torques otherwise (--allowed effort=SHARE)."
    )
    most = brentq(lambda share: binom.cdf(5, 50, share) - 0.05, 0.1, 0.5)
    assert f"{100 * most:.0f} %" == "20 %"
    # none of 19: 1 - 0.05^(1/19)
    assert "up to 15 % of those" in draws_said(19, 19)[0]
    assert (
        draws_said(20, 50)
        == draws_said(0, 3)
        == [
            "The data do not tell the mechanism well enough for this controller: it is not one for the true "
            "mechanism. Film what the report of the run advises, or choose another equilibrium or motor."
        ]
    )


@pytest.mark.slow
def test_torque_that_is_allowed_more_holds_tighter() -> None:
    """Bryson's rule against the closed form of a double integrator: with weights q = 1/x^2 and r = 1/u^2 the
    position's gain is about u / x, so twice the torque is about twice the gain of the slide."""
    _, fit = identified("cartpole")
    usual, loose = (control(fit, Aim(UP, ["slide"], allowed=one, rate=2000.0, draws=0))
                    for one in (Allowed(), Allowed(effort=1.0)))  # fmt: skip
    assert loose.document["weights"]["torques"][0][0] == pytest.approx(
        usual.document["weights"]["torques"][0][0] / 4.0
    )
    ratio = loose.regulator.gain[0, 0] / usual.regulator.gain[0, 0]
    assert ratio == pytest.approx(2.0, rel=0.05)


def refusal():
    from monodyn.estimation.fit import Doubt

    return Doubt("refused", "It is wrong.")


def test_a_pendubot_is_pushed_by_less() -> None:
    _, fit = identified("double")
    found = control(fit, Aim(UP, ["joint1"], draws=0))
    assert found.ok
    assert found.loop.position[0] - found.regulator.position == pytest.approx([0.0, 0.05])
    assert "It was let go with joint2 0.05 rad from the equilibrium; --start begins elsewhere." in found.notes


def test_from_where_it_is_balanced_is_said() -> None:
    """A motor at the elbow alone loses it from 0.05 rad; what is printed begins where it does not."""
    _, fit = identified("double")
    aim = Aim({"joint1": np.pi / 2.0}, ["joint2"], draws=0)
    fallen = control(fit, aim)
    push, at = fallen.push, fallen.regulator.position[0]
    assert push is not None
    assert (push.joint, push.far) == ("joint1", 0.05)
    assert 0.0 < push.held < 0.05
    assert fallen.loop.position[0, 0] - at == pytest.approx(0.05)
    assert fallen.status == (
        "In MuJoCo the identified mechanism does not stay balanced when joint1 is let go 0.05 rad from "
        f"the equilibrium, but from {push.held:.2g} rad it does: --start joint1={at + push.held:.6g} begins "
        "there."
    )
    near = control(fit, replace(aim, start={"joint1": round(at + push.held, 6)}))
    assert near.ok
    assert near.push is None
    assert push._replace(held=0.0).fallen == (
        "when joint1 is let go 0.05 rad from the equilibrium, nor from 0.0016 rad: measure more often "
        "(--rate), weigh the torques otherwise (--allowed effort=SHARE), or add a motor"
    )


def test_the_camera_of_the_film_sees_all_of_a_motion() -> None:
    mechanism = load("cartpole")
    position = np.array([[0.0, -1.5], [2.0, 1.5], [-1.0, 0.0]])
    camera = camera_for(mechanism, position)
    corners = np.vstack([polygon for q in position for polygon in outlines_of(mechanism, camera, q)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert np.all(low > 0.0)
    assert np.all(high < [720.0, 480.0])
    # it fills one side
    assert max((high - low) / [720.0, 480.0]) > 0.8


def test_what_belongs_to_a_swing_is_refused_without_one() -> None:
    _, fit = identified("cartpole")
    said = "control: expected limit, within and seconds together with swing, got them without; add --swing."
    with refuses(SettingsError, said):
        control(fit, Aim(UP, ["slide"], limit={"slide": 1.0}))
