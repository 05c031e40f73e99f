"""What a posterior predicts: bands with and without the discrepancy, and replicated data."""
