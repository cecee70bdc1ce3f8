"""Every exception that Monodyn raises on purpose, and whether one is Ctrl-C in other clothes.

The children are named by what has to be corrected: the mechanism file, the clip or the setting. A message is
one sentence: where, expected, got, what to do.
"""


class MonodynError(Exception):
    """Base of every exception that Monodyn raises on purpose."""


class MechanismError(MonodynError):
    """The mechanism file, or a parameter named for it, cannot be used."""


class VideoError(MonodynError):
    """The clip (or the encoder record) cannot be used."""


class SettingsError(MonodynError):
    """A setting, a frame range or an output folder cannot be used."""


class FitError(MonodynError):
    """A result is not to be trusted; raised by ``check()``, carries the status sentence."""


def is_interrupt(error: BaseException | None) -> bool:
    """Return whether Ctrl-C is behind an error, whatever it came out as.

    Within a compiled function it is a ``SystemError``, while a library is loaded an ``ImportError``.

    Args:
        error: What was raised; None is nothing.
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
