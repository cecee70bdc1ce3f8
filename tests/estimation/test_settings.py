"""Settings of the identification: what is refused, with whole messages."""

import pytest

from driven import DOUBLE, started
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.stages import identify
from support import refuses

PAPER_ALONE = (
    "identify.rates, identify.states: expected --identify.method paper with them, got the method 'fast'; "
    "choose that method, or leave them out."
)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        (
            {"torque": "magnetic"},
            "identify.torque: expected one of 'auto', 'friction', 'fourier', 'free', got 'magnetic'.",
        ),
        (
            {"terms": 3},
            "identify.terms: expected --identify.torque fourier with it, got 'auto'; choose that "
            "torque, or leave the terms out.",
        ),
        (
            {"torque": "fouier"},
            "identify.torque: expected one of 'auto', 'friction', 'fourier', 'free', got 'fouier'; did you "
            "mean 'fourier'?",
        ),
        (
            {"series": "alone"},
            "identify.series: expected --identify.torque fourier or free with it, got 'auto'; choose one "
            "of them, or leave the series out.",
        ),
        (
            {"series": "other", "torque": "free"},
            "identify.series: expected one of 'with-friction', 'alone', got 'other'.",
        ),
        ({"piece": 2}, "identify.piece: expected 5 to 10000, got 2."),
        ({"error_bound": 1.0}, "identify.error-bound: expected 1e-10 to 0.01, got 1."),
        ({"outlier": 1.5}, "identify.outlier: expected 0 or at least 3, got 1.5."),
    ],
)
def test_values_out_of_range(choice, message):
    with refuses(SettingsError, message):
        IdentifySettings(**choice)


@pytest.mark.parametrize("choice", [{"rates": True}, {"states": "filtered"}])
def test_settings_of_the_paper_are_refused_elsewhere(choice, passive, tmp_path):
    with refuses(SettingsError, PAPER_ALONE):
        PaperIdentifySettings(method="fast", **choice)
    with refuses(SettingsError, PAPER_ALONE):
        identify(passive[0], started(DOUBLE, tmp_path, 0.5), PaperIdentifySettings(**choice))


def test_gains_belong_to_the_paper_and_have_a_range():
    with refuses(
        SettingsError,
        "identify.gains: expected --identify.method paper with them, got the method 'fast'; choose that "
        "method, or leave the gains out.",
    ):
        PaperIdentifySettings(method="fast", gains=(0.5, 0.1, 0.01))
    with refuses(
        SettingsError,
        "gains: expected gamma between 0 and 4 alpha beta / (2 - alpha) = 0.1 (eq. 7) with alpha 0.4 and "
        "beta 0.1, got 3.",
    ):
        PaperIdentifySettings(gains=(0.4, 0.1, 3.0))
