"""The parameters of materials, discrepancies and noise, and their prior distributions."""
