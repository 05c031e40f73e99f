"""The same seven posteriors through tissuq and through what a user would pick instead, one library a file."""
