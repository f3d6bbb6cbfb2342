"""Descriptions as URDF and as Pinocchio model, shapes of links, and descriptions from URDFs and CAD files of others."""

from dhkit.model.cad_assembly import CadImport, import_cad
from dhkit.model.example_robots import (
    ExampleChain,
    example_chains,
    example_robots,
    example_urdf,
    urdf_source,
)
from dhkit.model.extraction import Extraction, Residual, extract_dh
from dhkit.model.mass_report import ReportedMass, read_mass_report
from dhkit.model.mesh_reader import read_mesh
from dhkit.model.reference import PinocchioModel, pinocchio_model
from dhkit.model.robot_folder import write_robot_with_meshes
from dhkit.model.shape_inertia import InertiaMethod, MassProperties, ShapeInertia, shape_inertia
from dhkit.model.shapes import Part, link_parts
from dhkit.model.triangle_mesh import TriangleMesh
from dhkit.model.urdf import urdf_text, write_urdf

__all__ = [
    "CadImport",
    "ExampleChain",
    "Extraction",
    "InertiaMethod",
    "MassProperties",
    "Part",
    "PinocchioModel",
    "ReportedMass",
    "Residual",
    "ShapeInertia",
    "TriangleMesh",
    "example_chains",
    "example_robots",
    "example_urdf",
    "extract_dh",
    "import_cad",
    "link_parts",
    "pinocchio_model",
    "read_mass_report",
    "read_mesh",
    "shape_inertia",
    "urdf_source",
    "urdf_text",
    "write_robot_with_meshes",
    "write_urdf",
]
