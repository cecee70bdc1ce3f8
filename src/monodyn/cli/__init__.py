"""The commands: ``run``, ``track``, ``identify``, ``models``. The only place that prints.

Each command is a frozen dataclass whose fields are its options. What a command is asked for is checked by the
stages themselves; here their errors become one line on the error stream and an exit code: 0 done, 1 the fit
is not to be trusted, 2 bad input or usage, 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

HELP = """usage: monodyn COMMAND ...

A clip of a planar mechanism in, a simulator of it out.

commands:
  run       track a clip, identify the mechanism, predict, write the run folder
  track     track a clip and write poses.csv
  identify  identify a mechanism from tables of joint positions
  models    list the bundled mechanisms

examples:
  monodyn run clip.mp4 --model double.xml --out run
  monodyn run clip.mp4 --model chain:3 --out run --fit-frames 0:120 --fix gravity=9.81
  monodyn identify run/poses.csv --model double.xml --out fit

monodyn COMMAND --help lists the options of a command. Exit codes: 0 done; 1 the fit is not to be trusted;
2 bad input or usage; 130 interrupted.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: The command line without the program's name; None takes it from the process.

    Returns:
        The exit code.
    """
    from monodyn.errors import FitError, MonodynError

    words = list(sys.argv[1:] if argv is None else argv)
    try:
        return _dispatch(words)
    except KeyboardInterrupt:
        _fail("interrupted; what was finished is in the output folder.")
        return 130
    except FitError as error:
        _fail(str(error))
        return 1
    except MonodynError as error:
        _fail(str(error))
        return 2
    except BrokenPipeError:
        sys.stderr.close()
        return 0


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(HELP, end="")
        return 0 if words else 2
    if words[0] in ("-V", "--version"):
        import monodyn

        print(f"monodyn {monodyn.__version__}")
        return 0
    from monodyn.cli.options import COMMANDS, parsed

    if words[0] not in COMMANDS:
        _fail(f"expected a command, got '{words[0]}'; commands: {', '.join(COMMANDS)}.")
        return 2
    options = parsed(words[0], words[1:])
    if isinstance(options, int):
        return options
    return options.go()


def _fail(message: str) -> None:
    print(f"monodyn: {' '.join(message.split())}", file=sys.stderr)
