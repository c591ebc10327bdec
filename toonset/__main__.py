"""Run the command line: the command `toonset`, and `python -m toonset`."""

import signal


def main() -> None:
    """Run a verb and leave with its exit code; Ctrl-C while modules load ends without a word."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # until `toonset.cli.main.run` hears it
    from toonset.cli.main import main as run_verb

    run_verb()


if __name__ == "__main__":
    main()
