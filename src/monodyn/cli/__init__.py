"""The commands: ``run``, ``live``, ``track``, ``identify``, ``predict``, ``control``, ``demo``, ``warm``,
``models``, ``reproduce``. The only place that prints.

``table`` makes the options of each command from the settings of a run, ``parse`` reads the words after a
command into them. The stages themselves check the values; here their errors become one line on the error
stream and an exit code: 0 done, 1 the fit is not to be trusted, 2 bad input or usage, 70 an error that nobody
foresaw, 129 its terminal was closed, 130 interrupted, 143 ended by SIGTERM.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

HELP = """Usage: monodyn COMMAND ...

A clip of a planar mechanism in, a simulator of it out.

Commands:
  run         track a clip, identify the mechanism, predict, write the run folder
  live        follow and identify a mechanism while a camera, a stream or a clip plays
  track       track a clip and write poses.csv
  identify    identify a mechanism from tables of joint positions
  predict     predict how the mechanism of a run moves, from any state or moment
  control     design a controller for the mechanism of a run, and simulate it
  demo        run the clip that is installed with the program
  warm        compile what runs need, once after installing
  models      list the bundled mechanisms
  completion  print a script by which bash, zsh or fish completes command lines
  reproduce   repeat the experiment of the 2012 paper and write a page about it

Examples:
  monodyn run clip.mp4 --model double.xml --out run
  monodyn run clip.mp4 --model chain:3 --out run --fit-frames 0:120 --fix gravity=9.81
  monodyn run --config run/run.toml --out again
  monodyn live 0 --model double.xml --view 8000 --out run
  monodyn identify run/poses.csv --model run --out fit
  monodyn predict run --from joint1=0.5,joint2=0 --until 5 --out ahead --film
  monodyn control run --at joint1=1.5708 --actuated slide --out balance

monodyn COMMAND --help shows the options of a command that most people need, --help-all all of them.

Exit codes:
  0    done
  1    the fit is refused
  2    bad input or usage
  70   an error of Monodyn itself
  129  the terminal was closed
  130  interrupted
  143  ended by SIGTERM
"""

SIGNALLED = 128
"""The exit code of a program that a signal has ended is this much more than the number of the signal."""
INTERRUPT = 2
"""The number of Ctrl-C (SIGINT)."""
SELDOM = (50_000, 20, 100)
"""Thresholds of the three generations of the garbage collector: what a process makes is arrays, and to search
what it imports for circles, again and again while it does, takes a twentieth of a run."""
UNFORESEEN = 70
"""Exit code of an error that nobody foresaw: an internal software error, by the custom of sysexits.h."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: The command line without the program's name; None takes it from the process.

    Returns:
        The exit code.
    """
    try:
        from monodyn.cli.streams import alone, safe

        if argv is None:
            # MuJoCo draws nothing here: what it would draw with takes time to load, and where this machine
            # lacks it keeps MuJoCo from being loaded; a program that calls us may draw with it
            os.environ["MUJOCO_GL"] = "disable"
            gc.set_threshold(*SELDOM)
        # whoever calls us in a process of their own wants to hear what libraries say
        with alone() if argv is None else nullcontext(), safe():
            return _main(list(sys.argv[1:] if argv is None else argv), own=argv is None)
    # before anything was loaded, or while the streams are put back
    except KeyboardInterrupt:
        return _interrupted()


def _main(words: list[str], *, own: bool) -> int:
    """Run one command, in a process of its own or in that of a caller."""
    # the matrices are small: more threads only wait for each other, and numpy reads this when it is loaded
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.flags.optimize > 1:
        _fail("python -OO: expected docstrings, which the help is made of, got none; leave -OO out.")
        return 2
    from monodyn.cli.streams import never_lost
    from monodyn.errors import FitError, MonodynError, is_interrupt, is_of_cache, is_unforeseen

    came: list[int] = []
    try:
        with never_lost() as came:
            return _dispatch(words, own=own)
    except KeyboardInterrupt as stop:
        # the second one does not wait until the first one can say what there is
        twice = ("what was written before stays.",) if len(came) > 1 else ()
        return _interrupted(*(stop.args or twice), number=(*came, INTERRUPT)[0])
    except Exception as error:
        # an import that is stopped may come out as a package that is not installed
        if is_interrupt(error):
            return _interrupted()
        if isinstance(error, MonodynError):
            _fail(str(error))
            return 1 if isinstance(error, FitError) else 2
        if is_of_cache(error):
            from monodyn.cli.compiled import forget_compiled

            forget_compiled()
            _fail(
                f"files of compiled functions were damaged ({type(error).__name__}), and were removed; "
                "the next command compiles them anew."
            )
            return 2
        if isinstance(error, OSError) and not is_unforeseen(error):
            from monodyn.typed import unusable

            _fail(unusable(error))
            return 2
        return _unforeseen(error)


def _interrupted(said: str = "nothing was written.", number: int = INTERRUPT) -> int:
    """Say that Ctrl-C was pressed, or another signal sent, and what there is; return the exit code."""
    # Python notes what leaves a text that is run, as in the making of a dataclass, and would end as if killed
    # by Ctrl-C whatever the exit code is: the next text takes the note away
    exec("")
    _fail(f"{'interrupted' if number == INTERRUPT else 'terminated'}; {said}")
    return SIGNALLED + number


def _unforeseen(error: Exception) -> int:
    """Say that Monodyn itself failed, and where the traceback is: next to the files of the run, if any."""
    from monodyn.results.unforeseen import traceback_text, where_sent

    said = where_sent(error)
    if not said:
        # no disk takes it: the terminal is the only place left
        print(traceback_text(error), file=sys.stderr)
        said = "please report it to its makers with the lines above."
    what = f"{type(error).__name__}: {' '.join(str(error).split())}"
    _fail(f"an error of Monodyn itself ({what}); {said}")
    return UNFORESEEN


def _dispatch(words: list[str], *, own: bool) -> int:
    from monodyn.cli.compiled import compiled_before, keep_compiled
    from monodyn.cli.streams import printing

    if not words or words[0] in ("-h", "--help", "--help-all", "help", "-V", "--version"):
        import monodyn
        from monodyn.cli.pages import fitted

        with printing():
            version = bool(words) and words[0] in ("-V", "--version")
            print(f"monodyn {monodyn.__version__}\n" if version else fitted(HELP), end="")
        return 0 if words else 2
    # a process that ends need not search all that it holds for circles, which takes a third of a second
    atexit.register(gc.freeze)
    # before the first import of numba, which chooses the folder when it is loaded
    note = keep_compiled()
    if note and "--quiet" not in words:
        _fail(note)
    from monodyn.cli.options import COMMANDS, CompletionOptions
    from monodyn.cli.parse import parsed
    from monodyn.names import meant, near, quoted

    if words[0] not in COMMANDS:
        asked = meant(near([*COMMANDS, "--help", "--version"], words[0]))
        _fail(f"expected a command, got '{words[0]}'; {asked or f'commands: {quoted(list(COMMANDS))}.'}")
        return 2
    options: Any = 0
    with printing():
        options = parsed(words[0], words[1:])
        # the script has the options of all commands, of which no command knows
        if isinstance(options, CompletionOptions):
            from monodyn.cli.completion import completion

            print(completion(options.shell), end="")
            return 0
    if isinstance(options, int):
        return options
    if own:
        from monodyn.cores import share_one_heap

        share_one_heap()
        if words[0] != LISTING:
            from monodyn.cli.loaded import load_to_call
            from monodyn.cli.owners import note_owners_before

            load_to_call()
            note_owners_before()
    if compiled_before():
        return options.go()
    if not getattr(options, "quiet", True) and sys.stderr.isatty():
        _fail("functions are compiled at first use, which takes minutes; monodyn warm does it beforehand.")
    if words[0] not in SEEING:
        return options.go()
    from monodyn.cli.warming import compiling_beside

    with compiling_beside():
        return options.go()


SEEING = ("run", "live", "demo", "warm")
"""Commands that need all that is compiled: what sees, and what identifies."""
LISTING = "models"
"""The command that computes nothing, and loads no compiled function."""
NAME = "monodyn: "
"""What a message begins with."""
LONGEST_WORD = 1000
"""Letters of a word that are written out: more than any name that can be meant has, or the path of a file."""


def _fail(message: str) -> None:
    from monodyn.names import short

    # what was given is repeated in it: it must not command the terminal
    message = "".join(c if c.isprintable() or c.isspace() else f"\\x{ord(c):02x}" for c in message)
    # the message itself is never cut: what to do stands at its end
    print(f"{NAME}{' '.join(short(word, LONGEST_WORD) for word in message.split())}", file=sys.stderr)
