"""Sentences that begin with a capital letter, unless a symbol is first."""

from __future__ import annotations


def capitalised(sentence: str) -> str:
    """Return a sentence with a capital first letter, unless it begins with a symbol: l1, dK/dq, a and d."""
    first, _, rest = sentence.partition(" ")
    is_word = first.rstrip(":").isalpha() and (len(first) > 2 or (first == "a" and not rest.startswith("and d ")))
    return sentence[0].upper() + sentence[1:] if is_word else sentence
