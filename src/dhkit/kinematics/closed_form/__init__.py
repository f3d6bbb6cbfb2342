"""Inverse kinematics in closed form, family by family, chosen by how an arm's axes lie."""

from dhkit.kinematics.closed_form.classify import Classification, classify

__all__ = ["Classification", "classify"]
