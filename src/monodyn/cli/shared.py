"""Options that commands share: how much is said, and whether what is in the folder may be replaced."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from monodyn.types import Progress


@dataclass(frozen=True, kw_only=True)
class QuietOptions:
    """What every command that takes a while has in common.

    Attributes:
        quiet: Show no progress and print nothing.
    """

    quiet: bool = False

    @contextmanager
    def progress(self) -> Iterator[Progress | None]:
        """Yield what shows progress on the error stream while the block runs, or None with ``--quiet``."""
        from monodyn.cli.show import progress_on

        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            yield progress


@dataclass(frozen=True, kw_only=True)
class FolderOptions(QuietOptions):
    """What every command that fills a folder has in common.

    Attributes:
        force: Replace the results that are already in DIR.
    """

    force: bool = False


@dataclass(frozen=True, kw_only=True)
class ResultOptions(FolderOptions):
    """What every command that prints a result has in common.

    Attributes:
        json: Print the result as JSON, in place of tables.
    """

    json: bool = False
