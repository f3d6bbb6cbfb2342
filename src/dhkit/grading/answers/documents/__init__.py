"""Answers out of LaTeX: rows of displays, statements that go on over rows, and statements of quantities."""
