"""The statistical model: material, discrepancy, noise and errors of the test as one joint density."""
