"""Whole studies: the paper's."""
