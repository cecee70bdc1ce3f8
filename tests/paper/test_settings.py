"""Settings that only the published method has: what they refuse, and how plain settings become them."""

from __future__ import annotations

from typing import Any

import pytest

from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.paper.settings import (
    PaperIdentifySettings,
    PaperLocateSettings,
    PaperTrackSettings,
    published,
)
from monodyn.vision.settings import LocateSettings, TrackSettings
from support import refuses

GAINS = (
    "identify.gains: expected --identify.method paper with them, got the method 'fast'; choose that method, "
    "or leave the gains out."
)
LIMITS = (
    "track.move_share, track.adaptive: expected --track.method paper with them, got the method 'fast'; "
    "choose that method, or leave the move limits out."
)
RATES = (
    "identify.rates, identify.states: expected --identify.method paper with them, got the method 'fast'; "
    "choose that method, or leave them out."
)

BEGIN = (
    "identify.begin: expected 'matched' with the fast method, got 'given'; it belongs to identify.method "
    "paper."
)
FILTER = (
    "identify.filter: expected 'printed' with the fast method, got 'consistent'; it belongs to "
    "identify.method paper."
)


@pytest.mark.parametrize(
    ("of", "given", "message"),
    [
        (
            PaperLocateSettings,
            {"method": "fast", "start": "evolution"},
            "locate.start: expected 'spread' with the fast method, got 'evolution'; it belongs to "
            "locate.method paper.",
        ),
        (
            PaperLocateSettings,
            {"start": "grid"},
            "locate.start: expected one of 'spread', 'evolution', got 'grid'.",
        ),
        (
            PaperLocateSettings,
            {"method": "fast", "framework": "interleaved"},
            "locate.framework: expected 'strict' with the fast method, got 'interleaved'; it belongs to "
            "locate.method paper.",
        ),
        (
            PaperLocateSettings,
            {"framework": "loose"},
            "locate.framework: expected one of 'strict', 'interleaved', got 'loose'.",
        ),
        (
            PaperLocateSettings,
            {"method": "fast", "level": 30.0},
            "locate.level: expected 0 with the fast method, got 30; it belongs to locate.method paper.",
        ),
        (PaperTrackSettings, {"method": "fast", "move_share": 0.2}, LIMITS),
        (PaperTrackSettings, {"method": "fast", "adaptive": False}, LIMITS),
        (PaperLocateSettings, {"level": 255.0}, "locate.level: expected 0 to 255 grey levels, got 255."),
        (PaperTrackSettings, {"move_share": 0.0}, "track.move_share: expected 0.001 to 0.5, got 0.0."),
        (
            PaperIdentifySettings,
            {"states": "smoothed"},
            "identify.states: expected one of 'measured', 'filtered', got 'smoothed'.",
        ),
        (
            PaperIdentifySettings,
            {"filter": "half"},
            "identify.filter: expected one of 'printed', 'consistent', got 'half'.",
        ),
        (
            PaperIdentifySettings,
            {"begin": "raw"},
            "identify.begin: expected one of 'matched', 'given', got 'raw'.",
        ),
        (PaperIdentifySettings, {"method": "fast", "begin": "given"}, BEGIN),
        (PaperIdentifySettings, {"method": "fast", "filter": "consistent"}, FILTER),
        (PaperIdentifySettings, {"method": "fast", "rates": True}, RATES),
        (PaperIdentifySettings, {"method": "fast", "states": "filtered"}, RATES),
        (PaperIdentifySettings, {"method": "fast", "gains": (0.5, 0.1, 0.05)}, GAINS),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(of: Any, given: dict[str, Any], message: str) -> None:
    with refuses(SettingsError, message):
        of(**given)


def test_plain_settings_become_those_of_the_method() -> None:
    assert published(LocateSettings(method="paper", seed=3), PaperLocateSettings) == PaperLocateSettings(
        method="paper", seed=3
    )
    assert published(TrackSettings(method="paper"), PaperTrackSettings).move_share == 0.1
    own = PaperIdentifySettings(method="paper", rates=True)
    assert published(own, PaperIdentifySettings) is own
    assert not published(IdentifySettings(method="paper"), PaperIdentifySettings).rates
