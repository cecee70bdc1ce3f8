"""Packages that are not always there."""

import sys
from types import ModuleType

import pytest

from monodyn.errors import SettingsError
from monodyn.extras import extra
from support import refuses


def test_a_package_that_is_there_is_returned():
    assert extra("test", "json.decoder", "nothing").JSONDecoder is not None


def test_one_that_is_not_is_named_with_what_installs_it(monkeypatch):
    said = (
        "test: expected the package 'absent', which is not installed; install it with pip install "
        "'monodyn[more]'."
    )
    with refuses(SettingsError, said):
        extra("test", "absent.part", "more")


def test_one_that_lacks_something_itself_says_so(monkeypatch):
    broken = ModuleType("broken")
    monkeypatch.setitem(sys.modules, "broken", broken)
    with pytest.raises(ModuleNotFoundError, match=r"broken\.part"):
        extra("test", "broken.part", "more")
