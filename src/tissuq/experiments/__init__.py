"""What was measured: experiments, loading modes, reading of laboratory files, built-in data."""
