"""The program: `tissuq`, and `python -m tissuq`."""

import os
import sys


def main() -> None:
    """Run the command line; an interrupt while its modules are loaded is no traceback.

    NumPy reads the number of OpenBLAS's threads when it is imported: more than one slow the many small matrices of a
    fit down.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from tissuq.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
