"""Pieces of figures: bands, points, densities and intervals on Matplotlib's axes; style and sizes of all figures."""
