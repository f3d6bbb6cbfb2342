"""The sections of a report, one file a subject; each function returns the blocks of its section.

What a robot does not have (bodies, a closed form, limits) is said in a sentence where it would stand.
"""
