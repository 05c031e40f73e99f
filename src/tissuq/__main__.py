"""The program: `tissuq`, and `python -m tissuq`."""

import gc
import os
import sys

NEW_OBJECTS_PER_COLLECTION = 50_000
"""Objects after which Python looks for circles of them: its default, 700, takes a tenth of a short command's time."""


def main() -> None:
    """Run the command line; an interrupt while its modules are loaded is no traceback.

    NumPy reads the number of OpenBLAS's threads when it is imported: more than one slow the many small matrices of a
    fit down.
    """
    gc.set_threshold(NEW_OBJECTS_PER_COLLECTION, *gc.get_threshold()[1:])
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from tissuq.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
