"""Mistakes of students: a library, the changes that each causes on a robot, and the search for those in an answer."""
