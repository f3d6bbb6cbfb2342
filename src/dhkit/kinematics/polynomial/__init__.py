"""Inverse kinematics of six revolute joints as the roots of one trigonometric polynomial in one joint angle.

An arm of six revolute joints reaches a pose in at most 16 ways (Primrose 1986, On the input-output equation of the
general 7R-mechanism). All other joints can be eliminated, which leaves a trigonometric polynomial of degree 8 in one
joint angle. Its values at equally spaced angles give its coefficients, and its real roots give the solutions.
"""
