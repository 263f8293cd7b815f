"""The command line: one table of commands, and what becomes of their errors."""

import logging
import sys

import typer

from mhvedit.commands.avoid import avoid
from mhvedit.commands.batch import batch
from mhvedit.commands.cache import cache
from mhvedit.commands.check import check
from mhvedit.commands.export import export
from mhvedit.commands.inspect import inspect
from mhvedit.commands.shared import BAD_INPUT, DONE, INTERRUPTED, help_if_alone
from mhvedit.commands.solve import demo, solve
from mhvedit.commands.version import version
from mhvedit.commands.view import view
from mhvedit.errors import MhveditError

STOPPED = "interrupted; the next run goes on from here"
COMMANDS = (
    demo,
    solve,
    inspect,
    check,
    view,
    export,
    avoid,
    batch,
    version,
)

app = typer.Typer(
    help="Put people who were filmed apart into one scene.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its import would take longer than everything else that `--help` does
    context_settings={"max_content_width": 120},
)
app.callback(invoke_without_command=True)(help_if_alone)
for command in COMMANDS:
    app.command()(command)
app.add_typer(cache, name="cache")


def main() -> None:
    """Run the command line; bad input becomes one line on stderr and exit code 2."""
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    sys.exit(_exit_code())


def _exit_code() -> int:
    """Run the command that was asked for; typer returns the code of an exit, and makes one of Ctrl-C."""
    try:
        code = int(app(standalone_mode=False) or DONE)
        return _complain(STOPPED, INTERRUPTED) if code == INTERRUPTED else code
    except MhveditError as fault:
        return _complain(str(fault), BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return _complain(STOPPED, INTERRUPTED)
    except OSError as fault:
        expected = "a file or folder that can be read and written"
        return _complain(
            f"{fault.filename or 'output'}: expected {expected}, found: {fault.strerror or fault}", BAD_INPUT
        )
    except MemoryError:
        return _complain(
            "expected a search that fits in memory: enlarge search.voxel, or reduce search.window", BAD_INPUT
        )
    except Exception as fault:
        if hasattr(fault, "format_message"):  # a usage error of the command line itself
            return _complain(fault.format_message(), BAD_INPUT)
        raise


def _complain(sentence: str, code: int) -> int:
    print(f"mhvedit: {' '.join(sentence.splitlines())}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
