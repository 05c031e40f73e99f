"""Campaigns that show how far the intervals can be trusted: the paper, coverage, calibration by simulation."""
