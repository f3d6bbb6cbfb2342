"""Benchmarks beside peers, with the targets that dhkit sets itself; run as ``python -m benchmarks.NAME``."""
