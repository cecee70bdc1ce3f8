"""Prediction: the motion after the fitted frames."""

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.mechanism.steps import spacing
from monodyn.results.fill import fill
from monodyn.results.predict import evenly, predict
from support import refuses

ALL = np.arange(120) / 30.0


def test_prediction_is_fill_after_the_fitted_frames(fit):
    future = predict(fit, until=3.5)
    assert future.time[0] == pytest.approx(ALL[80])
    assert future.time[-1] == pytest.approx(3.5)
    np.testing.assert_allclose(future.position, fill(fit, future.time).position, atol=1e-12)
    assert len(predict(fit).time) == 39  # as long again as the record
    sparse = predict(fit, times=np.array([3.0, 3.9]))
    whole = fill(fit, ALL)
    # the same motion with other steps: the integration errors of 1e-6 grow on the way
    np.testing.assert_allclose(sparse.position, whole.position[[90, 117]], atol=1e-4)
    assert len(predict(fit, until=3.5, times=np.array([3.0, 3.9])).time) == 1


def test_bad_input_is_refused(fit):
    said = "predict: expected a time after the last fitted frame at 2.63333 s, got 1 s."
    with refuses(SettingsError, said):
        predict(fit, until=1.0)
    with refuses(SettingsError, "predict: expected a record from 0 to 0, got 1."):
        predict(fit, record=1)
    step = ALL[80] - ALL[79]
    with refuses(
        SettingsError, f"until: expected at most 1000000 rows of {step:g} s, got 29999922; end it earlier."
    ):
        predict(fit, until=1e6)


def test_times_are_even_and_end_where_they_should():
    # 0.1 + 0.2 is more than 0.3
    np.testing.assert_allclose(evenly(0.1, 0.3, 0.1), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(evenly(0.1, 0.1 + 0.2, 0.1), [0.1, 0.2, 0.3])
    assert evenly(2.0, 2.0, 0.1).tolist() == [2.0]
    assert spacing(np.array([0.0, 0.1, 0.2, 0.9])) == pytest.approx(0.1)
    assert spacing(np.array([3.0])) == 0.05


def test_a_prediction_is_a_table_too(fit):
    pandas = pytest.importorskip("pandas")
    future = predict(fit, until=3.0)
    table = future.to_pandas()
    assert list(table.columns) == [
        "time", "joint1", "joint2", "joint1_vel", "joint2_vel", "joint1_std", "joint2_std",
        "joint1_vel_std", "joint2_vel_std",
    ]  # fmt: skip
    pandas.testing.assert_series_equal(
        table["joint2_vel"], pandas.Series(future.velocity[:, 1], name="joint2_vel")
    )
    pytest.importorskip("xarray")
    found = future.to_xarray()
    assert dict(found.sizes) == {"time": len(future), "joint": 2}
    np.testing.assert_array_equal(found["std"].sel(joint="joint1"), future.std[:, 0])


def test_a_prediction_says_in_one_line_what_it_is(fit):
    future = predict(fit, until=3.0)
    count, first = len(future), future.time[0]
    assert repr(future) == f"<Prediction of joint1, joint2: {count} times, {first:.2f} to 3.00 s>"
    assert future._repr_html_().count("<tr>") == 3
