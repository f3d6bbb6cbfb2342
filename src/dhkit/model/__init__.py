"""A description as URDF and as Pinocchio model, and what its links look like."""

from dhkit.model.reference import PinocchioModel, pinocchio_model
from dhkit.model.shapes import Part, link_parts
from dhkit.model.urdf import urdf_text, write_urdf

__all__ = ["Part", "PinocchioModel", "link_parts", "pinocchio_model", "urdf_text", "write_urdf"]
