"""A fit that was written and read back moves as it did, with the same bands; what is not a run is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from zoo import ZOO

import monodyn
from fits import identified
from monodyn.checks import chosen_mechanism
from monodyn.errors import FitError, SettingsError
from monodyn.estimation.fit import Doubt, Estimate
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import Measured
from monodyn.mechanism.simulate import simulate
from monodyn.pipeline import identify_tables
from monodyn.results import opened as opened_module
from monodyn.results.intact import check_model, digest, sealed
from monodyn.results.log import RunLog
from monodyn.results.opened import judged_before
from monodyn.settings import RunSettings
from monodyn.types import Poses
from support import refuses

TIME = np.arange(50) / 50.0


def pushed(name="double", **torque):
    """Return noisy poses of a bundled mechanism under a torque, and its start with that torque."""
    mechanism = monodyn.load(name).with_torque(**torque) if torque else monodyn.load(name)
    sizes = {n: 0.05 for n in mechanism.values if n.endswith((".torque.cos1", ".torque.sin1"))}
    moved = mechanism.with_values(sizes)
    dofs = len(mechanism.joints)
    q = simulate(moved, TIME, np.linspace(-1.2, 0.4, dofs), np.zeros(dofs)).position
    q = q + 1e-3 * np.random.default_rng(1).standard_normal(q.shape)
    covariance = np.repeat(1e-6 * np.eye(dofs)[None], len(TIME), axis=0)
    names = tuple(joint.name for joint in mechanism.joints)
    return Poses(names, np.arange(len(TIME)), TIME, q, covariance, np.ones(len(TIME), bool)), mechanism


@pytest.mark.parametrize(
    ("name", "settings", "torque"),
    [
        ("double", IdentifySettings(torque="friction"), {}),
        ("double", IdentifySettings(torque="friction", bodies="free"), {}),
        ("cartpole", IdentifySettings(torque="friction"), {}),
        (
            "single",
            IdentifySettings(torque="fourier", terms=1),
            {"model": "fourier", "terms": 1, "period": 0.4},
        ),
        ("single", IdentifySettings(torque="free"), {"model": "fourier", "terms": 1, "period": 0.4}),
    ],
)
@pytest.mark.slow
def test_a_run_is_read_back_as_it_was(tmp_path, name, settings, torque):
    poses, _ = pushed(name, **torque)
    fit = monodyn.identify(poses, monodyn.load(name), settings)
    # without the record nothing is added to what the fit says against itself
    monodyn.report(fit, to=tmp_path / "run")
    back = monodyn.open_run(tmp_path / "run")
    np.testing.assert_allclose(back.mechanism.tree.links, fit.mechanism.tree.links, rtol=1e-12, atol=1e-300)
    times = np.linspace(0.0, 1.5, 40)
    there, here = monodyn.fill(fit, times), monodyn.fill(back, times)
    np.testing.assert_allclose(here.position, there.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(here.std, there.std, rtol=1e-6)
    assert (back.grade, back.status, back.torque, back.ok) == (fit.grade, fit.status, fit.torque, fit.ok)
    length = f"{fit.mechanism.bodies[-1]}.length"
    assert back.parameter(length).std == fit.parameter(length).std
    assert f", {len(fit.shared)} estimated parameters from " in repr(back)


def test_a_body_that_came_out_wider_than_long_has_the_values_that_were_written(tmp_path):
    """Read as a file its longer side would be its length: value and interval were of two sides."""
    poses, start = pushed("cartpole")
    wide = start.with_choices(fix={"cart.width": 3.0 * start.values["cart.length"]})
    fit = monodyn.identify(poses, wide, IdentifySettings(torque="friction"))
    monodyn.report(fit, to=tmp_path / "run")
    back = monodyn.open_run(tmp_path / "run")
    for name in ("cart.length", "cart.width"):
        assert back.parameter(name).value == pytest.approx(fit.parameter(name).value, rel=1e-12)


def test_what_is_no_run_is_refused_in_one_line(tmp_path):
    folder = tmp_path / "none"
    with refuses(
        SettingsError,
        f"'{folder}': expected the folder of a run, got no such folder; name the one given as --out, of "
        "a run that came to a fit.",
    ):
        monodyn.open_run(folder)
    with refuses(
        SettingsError,
        f"'{tmp_path}': expected the folder of a run, got a folder without fit.json; name the one given as "
        "--out, of a run that came to a fit.",
    ):
        monodyn.open_run(tmp_path)


def identified_from(model, folder, table, **settings):
    return identify_tables([table], model, folder, RunSettings(**settings), force=True)


@pytest.mark.slow
def test_a_run_as_the_model_of_another_brings_along_what_its_picture_knew(tmp_path):
    """What the motion showed is a start and no more: intervals do not shrink when a record is read again."""
    mechanism = monodyn.load("single")
    names = ("link1.length", "link1.width")
    seen = Measured(names, np.array([[400.0, -400.0], [-400.0, 400.0]]))
    poses, _ = pushed("single")
    fit = monodyn.identify(poses, mechanism.with_measured(seen))
    folder, table = tmp_path / "run", tmp_path / "poses.csv"
    monodyn.write_poses(poses, table)
    identified_from("single", folder, table, fix={"gravity": 9.8})
    document = json.loads((folder / "fit.json").read_text())
    assert document["measured"] is None
    document["measured"] = {"names": names, "information": seen.information.tolist()}
    (folder / "fit.json").write_text(json.dumps(sealed(document)))
    again = monodyn.remembered(folder)
    assert again.measured.names == names
    assert again.values["gravity"] == 9.8
    assert not again.parameter("gravity").free
    length = {row["name"]: row["value"] for row in document["parameters"]}["link1.length"]
    assert again.values["link1.length"] == length
    second = identified_from(folder, tmp_path / "second", table).fit
    # gravity is given, whose error the first one had in addition
    assert second.parameter("link1.length").std == pytest.approx(fit.parameter("link1.length").std, rel=0.1)
    assert not second.parameter("gravity").free
    # and on from there, back to the same file
    third = identified_from(tmp_path / "second", tmp_path / "third", table).fit
    assert third.parameter("link1.length").value == pytest.approx(length, rel=1e-2)


@pytest.mark.slow
def test_a_folder_that_a_program_wrote_is_the_model_of_a_run(tmp_path):
    """With the file, what was given and what was freed: intervals stay what they were."""
    file = monodyn.load("double")
    given = {n: file.values[n] for n in ("link1.length", "link2.mass")}
    chosen = file.with_choices(fix=given, free=["gravity", "joint2.stiffness"])
    poses, _ = pushed("double")
    fit = monodyn.identify(poses, chosen, IdentifySettings(torque="friction"))
    monodyn.report(fit, to=tmp_path / "run")
    again = monodyn.remembered(tmp_path / "run")
    for name, value in given.items():
        assert not again.parameter(name).free
        assert again.values[name] == value
    # where a spring that is freed is slack is freed with it
    assert again.chosen == {*chosen.chosen, "joint2.rest"}
    monodyn.write_poses(poses, tmp_path / "poses.csv")
    settings = {"identify": IdentifySettings(torque="friction")}
    second = identified_from(tmp_path / "run", tmp_path / "second", tmp_path / "poses.csv", **settings).fit
    for name in ("gravity", "link2.length", "link1.mass"):
        there, here = fit.parameter(name), second.parameter(name)
        assert here.value == pytest.approx(there.value, abs=0.1 * there.std)
        assert here.std == pytest.approx(there.std, rel=0.05)


def test_what_a_program_measured_in_pictures_goes_along(tmp_path, monkeypatch):
    """Wherever the later command is run."""
    seen = Measured(("link1.length", "link1.width"), np.array([[400.0, -400.0], [-400.0, 400.0]]))
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    bundled = Path(monodyn.__file__).parent / "mechanism" / "models" / "single.xml"
    Path("own.xml").write_text(bundled.read_text())
    mechanism = monodyn.load("own.xml").with_measured(seen)
    fit = replace(identified(), mechanism=mechanism)
    monodyn.report(fit, to=tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    again = monodyn.remembered("run").measured
    assert again.names == seen.names
    np.testing.assert_array_equal(again.information, seen.information)
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "done"


@pytest.mark.slow
def test_what_is_assumed_of_sizes_is_not_assumed_twice(tmp_path):
    """A record that is identified again from where it ended comes out the same: its sizes are about the
    file's proportion, and not about what the motion made of that."""
    table, file = tmp_path / "poses.csv", monodyn.load("double").values
    monodyn.write_poses(pushed("double")[0], table)
    settings = {"identify": IdentifySettings(torque="friction")}
    first = identified_from("double", tmp_path / "first", table, **settings).fit
    again = monodyn.remembered(tmp_path / "first").values
    for size in ("link1.tail", "link1.tip", "link1.width", "link2.tail", "link2.width"):
        length = f"{size.partition('.')[0]}.length"
        assert again[size] / again[length] == pytest.approx(file[size] / file[length], rel=1e-12)
        assert again[length] == first.parameter(length).value
    second = identified_from(tmp_path / "first", tmp_path / "second", table, **settings).fit
    for name in ("link1.tail", "link2.width", "link1.length"):
        there, here = first.parameter(name), second.parameter(name)
        assert here.value == pytest.approx(there.value, rel=0.01)
        assert here.std == pytest.approx(there.std, rel=0.01)


def test_what_the_run_before_knew_is_named(tmp_path):
    fit = identified()
    monodyn.report(fit, to=tmp_path / "run")
    length = fit.parameter("link1.length")
    assert length.identifiable
    lost = replace(length, std=np.inf, identifiable=False)
    now = replace(fit, parameters=tuple(lost if p is length else p for p in fit.parameters))
    assert opened_module.known_before(tmp_path / "run", now) == [
        f"The motion of '{tmp_path / 'run'}' determined link1.length ({length.value:.4g} ± {length.std:.2g} "
        "m), which counts for that record alone: identify both records together (monodyn identify with both "
        "tables) to have it here."
    ]
    assert opened_module.known_before(tmp_path / "run", fit) == []
    assert opened_module.known_before("single", now) == []


def test_a_bundled_name_is_the_mechanism_whatever_folder_has_that_name(tmp_path, monkeypatch):
    """As with ``--model single --out single``: the run's own folder is there when it is asked again."""
    monkeypatch.chdir(tmp_path)
    for name in ("single", "chain:3", "auto"):
        (tmp_path / name).mkdir()
        assert not opened_module.is_run(name)
        assert name == "auto" or chosen_mechanism(name, RunSettings(), camera=False).name == name
        assert RunLog("identify", {"model": name}, RunSettings()).inputs["model"] == {"name": name}
    assert opened_module.known_before("single", identified()) == []
    # a folder of that name is given as a path
    assert opened_module.is_run("./single")
    with pytest.raises(SettingsError, match=r"fit\.json"):
        chosen_mechanism("./single", RunSettings(), camera=False)


def test_the_mechanism_file_of_a_run_has_to_be_there(tmp_path):
    model, table, folder = tmp_path / "own.xml", tmp_path / "poses.csv", tmp_path / "run"
    monodyn.write_mjcf(monodyn.load("single"), model)
    monodyn.write_poses(pushed("single")[0], table)
    identified_from(model, folder, table, identify=IdentifySettings(torque="friction"))
    assert monodyn.remembered(folder).name == "single"
    model.rename(folder / "own.xml")
    assert monodyn.remembered(folder).name == "single"
    (folder / "own.xml").write_text("<mujoco/>")
    with refuses(
        SettingsError,
        f"model '{folder}': expected the mechanism file of that run, '{model}', as it was then, got none; "
        "put it there, or into the folder.",
    ):
        monodyn.remembered(folder)


def test_a_run_folder_that_is_named_like_its_bundled_model_goes_on(tmp_path, monkeypatch):
    """Whose mechanism is the bundled one, and not the folder again."""
    monkeypatch.chdir(tmp_path)
    monodyn.write_poses(pushed("single")[0], "poses.csv")
    settings = {"identify": IdentifySettings(torque="friction")}
    first = identified_from("single", "single", "poses.csv", **settings).fit
    for k, given in enumerate(("./single", str(tmp_path / "single"), Path("single"))):
        assert monodyn.remembered(given).values["link1.length"] == first.parameter("link1.length").value
        identified_from(given, f"second{k}", "poses.csv", **settings)
        # and on from there: not from the bundled mechanism, whose name the folder has
        known = opened_module.origins(f"second{k}")
        assert [path.resolve() for path in known[2:4]] == [
            tmp_path / "single" / name for name in ("fit.json", "run.json")
        ]


def test_a_refused_run_opens_and_says_what_it_is(tmp_path):
    """Whether a search ended somewhere, or there was nothing to begin with."""
    doubt = Doubt("refused", "Too dark.")
    searched = replace(identified(), rms={"joint1": math.inf}).doubted([doubt])
    still = Poses(
        ("joint1",), np.arange(3), TIME[:3], np.zeros((3, 1)), np.full((3, 1, 1), 1e-6), np.ones(3, bool)
    )
    nothing = monodyn.identify(still, monodyn.load("single"))
    assert not nothing.starts
    for name, fit in (("searched", searched), ("nothing", nothing)):
        monodyn.report(fit, to=tmp_path / name)
        back = monodyn.open_run(tmp_path / name)
        assert (back.status, back.grade, back.ok) == (fit.status, "refused", False)
        assert repr(back).startswith("<Fit of 'single': refused, ")
        assert back.parameter("gravity").value == 9.81
        assert np.isnan(back.rms["joint1"])
        with refuses(FitError, fit.status):
            back.check()
    assert monodyn.predict(monodyn.open_run(tmp_path / "searched"), until=1.0).position.shape[1] == 1
    back = monodyn.open_run(tmp_path / "nothing")
    ask = {
        "predict": lambda: monodyn.predict(back, until=2.0),
        "restart": lambda: monodyn.restart(back, {"joint1": 0.5}),
        "fill": lambda: monodyn.fill(back, TIME),
    }
    for where, asked in ask.items():
        with refuses(
            SettingsError,
            f"{where}: expected an identified mechanism, got a fit without one: {nothing.status}",
        ):
            asked()
    folder = tmp_path / "nothing"
    with refuses(
        SettingsError,
        f"'{folder}': expected an identified mechanism, got a run without one: {nothing.status}",
    ):
        monodyn.remembered(folder)


def test_a_run_that_leads_back_to_itself_is_refused(tmp_path):
    table, folder = tmp_path / "poses.csv", tmp_path / "run"
    monodyn.write_poses(pushed("single")[0], table)
    identified_from("single", folder, table, identify=IdentifySettings(torque="friction"))
    log = json.loads((folder / "run.json").read_text())
    log["inputs"]["model"] = {"name": str(folder)}
    (folder / "run.json").write_text(json.dumps(log))
    with refuses(
        SettingsError,
        f"model '{folder}': expected a run that leads back to a mechanism file, got one that leads to "
        f"'{folder}' again; give the file itself with --model.",
    ):
        monodyn.remembered(folder)


@pytest.mark.slow
def test_a_run_never_replaces_those_from_which_its_mechanism_comes(tmp_path):
    """Neither the one that is its model nor one before that: their files are what it leads back to."""
    first, second, table = tmp_path / "first", tmp_path / "second", tmp_path / "poses.csv"
    monodyn.write_poses(pushed("single")[0], table)
    settings = {"identify": IdentifySettings(torque="friction")}
    identified_from("single", first, table, **settings)
    identified_from(first, second, table, **settings)
    written = (first / "run.json").read_text()
    for model, out in ((first, first), (second, second), (second, first)):
        with refuses(
            SettingsError,
            f"out '{out}': expected another folder than that of the inputs, got the one of "
            f"'{out / 'fit.json'}', which the run would replace; give another with --out.",
        ):
            identified_from(model, out, table, **settings)
    assert (first / "run.json").read_text() == written
    # what came of a run may be replaced
    identified_from(first, second, table, **settings)
    assert opened_module.origins(second) == [
        *(folder / name for folder in (second, first) for name in ("fit.json", "run.json")),
        Path("single"),
    ]


def test_a_file_of_another_form_is_refused(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    monodyn.report(identified(), to=folder)
    file = folder / "fit.json"
    document = json.loads(file.read_text())

    def opened(**change):
        file.write_text(json.dumps(sealed({**document, **change})))
        return monodyn.open_run(folder)

    assert opened().status == identified().status
    for schema, got in ((1, "1"), (None, "none")):
        with refuses(
            SettingsError,
            f"'{file}': expected a file of schema 2, got {got}; run it again with this version.",
        ):
            opened(schema=schema)
    for change, kind, what in (
        ({"parameters": [{"name": "gravity"}]}, "KeyError", "'value'"),
        ({"covariance": {"names": [], "matrix": []}}, "ValueError", "'record0.joint1' is not in list"),
    ):
        with refuses(
            SettingsError,
            f"'{file}': expected the file as it was written, got one without what it should hold "
            f"({kind}: {what}); run it again.",
        ):
            opened(**change)
    file.write_text("{")
    with refuses(
        SettingsError,
        f"'{file}': expected JSON, got other text (Expecting property name enclosed in double quotes: line 1 "
        "column 2 (char 1)); run it again.",
    ):
        monodyn.open_run(folder)
    monkeypatch.setattr(opened_module, "LARGEST", 0)
    with refuses(SettingsError, f"'{file}': expected a file of a run, got one of 1 bytes; run it again."):
        monodyn.open_run(folder)


def doubled(document):
    """Double a value and its interval, whole."""
    row = next(row for row in document["parameters"] if row["name"] == "joint1.damping")
    row |= {name: 2.0 * row[name] for name in ("value", "std", "lower", "upper") if row[name]}


def narrowed(document):
    """Make every band a hundred times narrower."""
    rows = document["covariance"]["matrix"]
    rows[:] = [[1e-4 * x for x in row] for row in rows]


CHANGES = [
    doubled,
    narrowed,
    lambda document: document["initial_state"][0]["position"].update(joint1=5.0),
    lambda document: document["parameters"][0].update(std=document["parameters"][0]["std"] / 2.0),
    lambda document: document["parameters"][0].update(value=float(np.nextafter(1.0, 2.0))),
    lambda document: document.update(parameters=[]),
    lambda document: document.update(mine="a field of one's own"),
    lambda document: document.pop("model_sha256"),
    lambda document: document["drive"].update(time_scale=1),
]
"""What may be changed by hand in a ``fit.json``: what contradicts the rest of it, and what does not."""


@pytest.mark.parametrize("change", CHANGES)
def test_a_fit_that_was_changed_after_it_was_written_is_refused(tmp_path, change):
    file = tmp_path / "run" / "fit.json"
    monodyn.report(identified(), to=tmp_path / "run")
    document = json.loads(file.read_text())
    # in what order, and how far indented, its fields stand is no content
    file.write_text(json.dumps(dict(reversed(document.items()))))
    assert monodyn.open_run(tmp_path / "run").status == identified().status
    change(document)
    file.write_text(json.dumps(document))
    for read in (monodyn.open_run, monodyn.remembered, opened_module.filmed_by):
        with refuses(
            SettingsError,
            f"'{file}': expected the file as it was written, got one that was changed since; run it again, "
            "or give other values with --fix.",
        ):
            read(tmp_path / "run")


def test_a_fit_that_does_not_state_its_content_is_refused(tmp_path):
    file = tmp_path / "run" / "fit.json"
    monodyn.report(identified(), to=tmp_path / "run")
    document = json.loads(file.read_text())
    del document["sha256"]
    file.write_text(json.dumps(document))
    with refuses(
        SettingsError,
        f"'{file}': expected the file as it was written, got one without its sha256; run it again, or give "
        "other values with --fix.",
    ):
        monodyn.open_run(tmp_path / "run")


@pytest.mark.parametrize(
    ("kind", "values"), [("fourier", {"period": 0.7}), ("free", {"knots": [0.0, 0.3, 0.6]})]
)
def test_a_fit_under_torques_over_time_is_read_back(tmp_path, kind, values):
    knots = np.array(values.get("knots", []))
    single = identified().mechanism.with_torque(kind, terms=1, period=values.get("period"), knots=knots)
    rows = [Estimate(p.name, p.value, 0.0, p.value, p.value, p.unit, False, True, False)
            for p in single.parameters if "torque" in p.name]  # fmt: skip
    parameters = (*identified().parameters, *rows)
    monodyn.report(replace(identified(), mechanism=single, torque=kind, parameters=parameters), to=tmp_path)
    assert monodyn.open_run(tmp_path).torque == kind


@pytest.mark.parametrize("text", ["NaN", "-Infinity", "1e999"])
def test_what_is_no_number_is_refused(tmp_path, text):
    file = tmp_path / "run" / "fit.json"
    monodyn.report(identified(), to=tmp_path / "run")
    scale = json.loads(file.read_text())["scale"]
    file.write_text(file.read_text().replace(f'"scale": {scale}', f'"scale": {text}'))
    with refuses(
        SettingsError, f"'{file}': expected JSON, got other text ({text} is no number); run it again."
    ):
        monodyn.open_run(tmp_path / "run")


DO = "keep changed models elsewhere, give other values with --fix, or run it again."


def test_a_run_without_its_model_says_so(tmp_path):
    folder = tmp_path / "run"
    monodyn.report(identified(), to=folder)
    (folder / "model.xml").unlink()
    with refuses(
        SettingsError,
        f"'{folder}': expected the folder of a run with its model.xml, got one without; put it back, or run "
        "it again.",
    ):
        monodyn.open_run(folder)


def test_a_model_that_was_changed_beside_its_fit_is_refused(tmp_path):
    fit, file = identified(), tmp_path / "run" / "model.xml"
    monodyn.report(fit, to=tmp_path / "run")
    written, damping = file.read_text(), fit.mechanism.values["joint1.damping"]
    assert f'damping="{damping!r}"' in written
    file.write_text(written.replace(f'damping="{damping!r}"', 'damping="0.5"'))
    with refuses(
        SettingsError,
        f"'{file}': expected joint1.damping {damping:.10g} as in fit.json, got 0.5; {DO}",
    ):
        monodyn.open_run(tmp_path / "run")
    file.write_text(written.replace('gravity="0.0 0.0 -9.81"', 'gravity="0 0 -1.62"'))
    with refuses(SettingsError, f"'{file}': expected gravity 9.81 as in fit.json, got 1.62; {DO}"):
        monodyn.open_run(tmp_path / "run")
    both = written.replace('gravity="0.0 0.0 -9.81"', 'gravity="0 0 -1.62"')
    file.write_text(both.replace(f'damping="{damping!r}"', 'damping="0.5"'))
    with refuses(
        SettingsError,
        f"'{file}': expected joint1.damping {damping:.10g} as in fit.json, got 0.5 (and 1 more); {DO}",
    ):
        monodyn.open_run(tmp_path / "run")
    file.write_text(written.replace('"joint1"', '"elbow"'))
    with refuses(SettingsError, f"'{file}': expected the joints of fit.json, joint1, got elbow; {DO}"):
        monodyn.open_run(tmp_path / "run")
    file.write_text(written.replace('"link1', '"arm'))
    with refuses(
        SettingsError,
        f"'{file}': expected the bodies of fit.json, got also arm; {DO}",
    ):
        monodyn.open_run(tmp_path / "run")
    # what stands beside the numbers may be changed
    file.write_text(written.replace("<mujoco", "<!-- mine -->\n<mujoco", 1))
    assert monodyn.open_run(tmp_path / "run").status == fit.status


@pytest.mark.parametrize("name", ["cart_branches", "shapes", "tree"])
def test_a_file_as_it_was_written_is_believed_and_moves_as_the_fit(tmp_path, name):
    """Several joints on a cart, meshes: read back, sizes are shared out otherwise, and the motion is not."""
    (tmp_path / "given.xml").write_text(ZOO[name])
    mechanism = monodyn.load(tmp_path / "given.xml")
    rng, free = np.random.default_rng(3), [p for p in mechanism.parameters if p.free and p.value > 0]
    mechanism = mechanism.with_values({p.name: p.value * rng.uniform(0.7, 1.4) for p in free})
    monodyn.write_mjcf(mechanism, tmp_path / "model.xml")
    rows = {p.name: {"name": p.name, "value": p.value} for p in mechanism.parameters}
    document = {
        "parameters": list(rows.values()),
        "units": {joint.name: "" for joint in mechanism.joints},
        "drive": {"model": "friction"},
        "mass_scale": None,
    }
    written = monodyn.load(tmp_path / "model.xml")
    known = {**document, "model_sha256": digest(tmp_path / "model.xml")}
    check_model(tmp_path / "model.xml", written, known)
    if name != "tree":
        with pytest.raises(SettingsError, match="length"):
            check_model(tmp_path / "model.xml", written, {**document, "model_sha256": "another"})
    back, _ = opened_module._mechanism(document, written, rows, [])
    state = rng.uniform(-1.0, 1.0, (2, len(mechanism.joints)))
    there, here = (simulate(m, TIME, *state, tolerance=1e-10).position for m in (mechanism, back))
    np.testing.assert_allclose(here, there, atol=1e-8)


def test_a_joint_without_damping_is_one_in_both_files(tmp_path):
    """MJCF without a damping is read with one to start at."""
    undamped = monodyn.load("single").with_choices(fix={"joint1.damping": 0.0})
    fit = monodyn.identify(pushed("single")[0], undamped, IdentifySettings(torque="friction"))
    monodyn.report(fit, to=tmp_path / "run")
    assert "damping=" not in (tmp_path / "run" / "model.xml").read_text()
    assert monodyn.open_run(tmp_path / "run").mechanism.values["joint1.damping"] == 0.0


def test_the_clip_of_a_run_is_where_its_log_has_it(tmp_path):
    assert opened_module.clip_of(tmp_path) is None
    log = tmp_path / "run.json"
    log.write_text(json.dumps({"inputs": {"clip": {"name": "swing.mp4"}}}))
    assert opened_module.clip_of(tmp_path).name == "swing.mp4"
    log.write_text(json.dumps({"inputs": {"poses 1": {"name": "a.csv"}}}))
    assert opened_module.clip_of(tmp_path) is None
    log.write_text(json.dumps({"inputs": {"clip": {}}}))
    with refuses(
        SettingsError,
        f"'{log}': expected the file as it was written, got one without what it should hold "
        "(KeyError: 'name'); run it again.",
    ):
        opened_module.clip_of(tmp_path)


def test_a_stream_that_was_judged_otherwise_is_said():
    fit = identified()
    assert judged_before(fit.grade, fit, (0, 40)) == []
    assert judged_before(None, fit, (0, 40)) == []
    assert judged_before("refused", fit, (3, 40)) == [
        "At the last frame of the stream the verdict was refused, by the seconds before it; that of frames 3 "
        f"to 39 together is {fit.grade}."
    ]
