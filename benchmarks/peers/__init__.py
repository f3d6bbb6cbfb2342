"""Peers of the benchmarks of motions and simulation; each package is imported when its peer is set up."""
