"""MuJoCo without its log: by itself it prints a warning and writes a file into the folder of the user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def unlogged(mujoco: Any) -> Iterator[list[str]]:
    """Collect what MuJoCo warns of in the block, in place of printing it and writing ``MUJOCO_LOG.TXT``.

    Args:
        mujoco: The module.

    Yields:
        The warnings so far.
    """
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)
    try:
        yield said
    finally:
        mujoco.set_mju_user_warning(before)
