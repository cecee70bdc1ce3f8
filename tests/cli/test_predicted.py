"""``monodyn predict``: its table, its JSON, its exit codes."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import monodyn
from fits import identified, record
from monodyn.choices import Tolerance
from monodyn.cli import predicted
from monodyn.estimation.fit import Doubt, Estimate
from monodyn.results.predicted import Wanted, predict_run
from support import command


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("predicted") / "run"
    monodyn.report(identified(), to=folder, poses=record(identified()))
    return folder


def test_the_table_has_the_start_and_the_end_and_says_how_long_it_holds(run, tmp_path):
    done = command("predict", run, "--from", "joint1=0.5", "--until", 2, "--out", tmp_path / "ahead")
    assert done.code == 0
    assert "28.65 ± 0" in done.out  # 0.5 rad in degrees, exactly
    assert "2.000 s" in done.out
    assert "after the start" in done.out or "over all of the" in done.out
    assert f"plot: {tmp_path / 'ahead'}/prediction.html" in done.out
    assert (tmp_path / "ahead" / "prediction.csv").is_file()


def test_the_film_is_named(run, tmp_path, capsys):
    found = predict_run(run, tmp_path / "ahead", Wanted({"joint1": 0.5}))
    for film in (False, True):
        predicted._print(found, Tolerance(), film=film)
        said = capsys.readouterr().out
        assert (f"film: {tmp_path / 'ahead'}/prediction.mp4\n" in said) is film


def test_the_table_has_half_the_width_of_the_band_and_says_so(run):
    done = command("predict", run, "--until", 2)
    document = json.loads(command("predict", run, "--until", 2, "--quiet", "--json").out)
    half = 1.96 * np.degrees(document["position_std"]["joint1"])
    assert half[-1] > 0.0
    rows = [line for line in done.out.splitlines() if "±" in line]
    assert f"± {half[0]:.2g} " in rows[0]
    assert f"± {half[-1]:.2g} " in rows[-2]
    assert rows[-1] == "± half the width of the 95 % band"


def test_the_rows_of_the_table_are_evenly_apart(run):
    for until in (0.04, 2, 2.63):
        done = command("predict", run, "--from", "joint1=0.5", "--until", until)
        times = [float(found) for found in re.findall(r"^ *([0-9.]+) s ", done.out, re.MULTILINE)]
        steps = np.diff(times)
        assert 2 <= len(times) <= 11
        assert steps[:-1] == pytest.approx(steps[0], abs=2e-3)
        assert steps[-1] <= steps[0] + 2e-3


def test_json_alone_is_printed_and_commas_may_stand_between_joints(run):
    done = command("predict", run, "--from", "joint1=0.5,", "--rates=joint1=1", "--quiet", "--json")
    document = json.loads(done.out)
    assert document["velocity"]["joint1"][0] == 1.0
    assert document["position_std"]["joint1"][0] == 0.0
    assert document["out"] is None


def test_the_settings_file_of_a_prediction_does_it_again(run, tmp_path):
    words = (
        "--from", "joint1=0.1", "--rates", "joint1=0.3", "--at", 1, "--until", 2,
        "--fix", "gravity=1.62", "--tolerance", "3deg,1cm",
    )  # fmt: skip
    first, second = tmp_path / "first", tmp_path / "second"
    assert command("predict", run, *words, "--out", first).code == 0
    assert command("predict", "--config", first / "run.toml", "--out", second).code == 0
    assert (second / "run.toml").read_text() == (first / "run.toml").read_text()
    assert (second / "prediction.csv").read_bytes() == (first / "prediction.csv").read_bytes()
    assert (second / "prediction.json").read_bytes() == (first / "prediction.json").read_bytes()


def test_what_is_missing_is_named(run, tmp_path):
    for words, code, message in [
        (("--film",), 2, "monodyn: film: expected a folder for it, got none; name one with --out."),
        (("--from", ""), 2, "monodyn: from: expected JOINT=POSITION with a number, got ''; e.g. joint1=0.5."),
        (("--from", "joint1=0", "joint1=1"), 2, "monodyn: from: expected each name once, got 'joint1' twice; "
         "keep one of them."),
    ]:  # fmt: skip
        done = command("predict", run, *words)
        assert (done.code, done.err.strip()) == (code, message)
    done = command("predict")
    assert (done.code, done.out) == (2, "")
    assert done.err == "monodyn: predict: expected RUN, got nothing; see monodyn predict --help.\n"


def test_a_refused_fit_predicts_with_exit_code_1_and_says_so(tmp_path):
    refused = identified().doubted([Doubt("refused", "It is another mechanism.")])
    monodyn.report(refused, to=tmp_path / "run")
    done = command("predict", tmp_path / "run")
    assert done.code == 1
    assert "- The mechanism is not to be relied on: It is another mechanism." in done.out
    quiet = command("predict", tmp_path / "run", "--quiet")
    assert (quiet.code, quiet.out, quiet.err) == (1, "", "monodyn: It is another mechanism.\n")


def test_torques_that_belong_to_a_record_are_not_in_its_prediction(tmp_path):
    single = identified().mechanism
    free = single.with_torque("free", knots=np.array([0.0, 0.3, 0.6]))
    for torque, mechanism, said in (
        ("known", single.with_torque("known"), "- The known torques belong to the record: here none act."),
        (
            "free",
            free,
            "- Free torques are known within the fitted frames alone: outside of these none act.",
        ),
    ):
        fit = replace(identified(), mechanism=mechanism, torque=torque)
        monodyn.report(fit, to=tmp_path / torque)
        done = command("predict", tmp_path / torque, "--from", "joint1=0.5", "--until", 1)
        assert said in done.out


def test_torques_that_act_on_are_told(tmp_path):
    single = identified().mechanism.with_torque("fourier", terms=1, period=0.7)
    torques = [Estimate(p.name, p.value, 0.0, p.value, p.value, p.unit, False, True, False)
               for p in single.parameters if "torque" in p.name]  # fmt: skip
    parameters = (*identified().parameters, *torques)
    fit = replace(identified(), mechanism=single, torque="fourier", parameters=parameters)
    monodyn.report(fit, to=tmp_path / "run")
    words = ("predict", tmp_path / "run", "--from", "joint1=0.5", "--at", 0.2, "--until", 1)
    assert json.loads(command(*words, "--quiet", "--json").out)["notes"] == [
        "The torques over time that were identified act here, too: it begins with those of 0.2 s, and with "
        "others at another --at."
    ]
