"""``torques.csv`` of a run in, the known torques of its records out, as logs again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from monodyn.errors import SettingsError, VideoError
from monodyn.estimation.record.tables import row_numbers, table_rows
from monodyn.types import TorqueLog


def known_torques(file: Path, joints: Sequence[str], *, records: int, lag: float) -> tuple[TorqueLog, ...]:
    """Read known torques back.

    The table has what acted, which is the log ``lag`` later. It reaches as far as record and prediction; rows
    without a deviation are before or after the log, and stand for nothing.

    Args:
        file: The table.
        joints: Joint names.
        records: How many records there are.
        lag: How much later than in their logs they act [s].

    Returns:
        The log of each record; none where none acts.

    Raises:
        SettingsError: There is no such table, or it was changed.
    """
    if not file.is_file():
        raise SettingsError(
            f"'{file.parent}': expected the folder of a run under known torques with its {file.name}, got "
            "one without; put it back, or run it again."
        )
    try:
        header, rows = table_rows(file, "torques")
        table = np.array([row_numbers(file, header, row, line) for line, row in rows])
        number = table[:, header.index("record")] if "record" in header else np.zeros(len(table))
        at, acts, stds = (
            [header.index(name) for name in names]
            for names in (["time"], joints, [f"{joint}_std" for joint in joints])
        )
        if not table[:, acts].any():
            return ()
        # without any covariance no row has a deviation
        inside = np.isfinite(table[:, stds]).all(axis=1)
        inside |= not inside.any()
        logs = []
        for record in range(records):
            own = table[inside & (number == record)]
            logs.append(TorqueLog(tuple(joints), own[:, at[0]] - lag, own[:, acts]))
        return tuple(logs)
    except (VideoError, ValueError) as error:
        raise SettingsError(
            f"'{file}': expected the file as it was written, got another one ({error}); run it again."
        ) from None
