"""Packages that only some of the program needs, and that are not always installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from monodyn.errors import SettingsError


def extra(where: str, module: str, name: str) -> Any:
    """Return a module of an optional package.

    Args:
        where: What needs it, for the message.
        module: The module.
        name: The extra of Monodyn that installs the package.

    Returns:
        The module.

    Raises:
        SettingsError: The package is not installed.

    Example:
        >>> extra("example", "json", "nothing").dumps([])
        '[]'
    """
    package = module.partition(".")[0]
    try:
        import_module(package)
        return import_module(module)
    except ModuleNotFoundError as error:
        # a package that is there and lacks something itself says so
        if error.name != package:
            raise
        raise SettingsError(
            f"{where}: expected the package '{package}', which is not installed; install it with "
            f"pip install 'monodyn[{name}]'."
        ) from None
