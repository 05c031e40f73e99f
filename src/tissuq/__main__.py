"""`python -m tissuq` is `tissuq`."""

from tissuq.cli import main

main()
