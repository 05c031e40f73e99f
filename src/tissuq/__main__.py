"""The program: `tissuq`, and `python -m tissuq`."""

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command line; an interrupt while its modules are loaded is no traceback."""
    try:
        from tissuq.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
