"""The local page of ``tissuq app``: files in, the answer out, in a browser on the same computer."""
