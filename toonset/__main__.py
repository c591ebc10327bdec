"""Run the command line: `python -m toonset`."""

from toonset.cli.main import main

if __name__ == "__main__":
    main()
