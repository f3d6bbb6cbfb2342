"""Answers held against the truth: exactly where the ring has them, in many digits or by closing FK where not."""
