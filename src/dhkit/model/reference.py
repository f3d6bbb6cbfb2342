"""Descriptions as Pinocchio models, built from their URDF: the reference path."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

from dhkit.description import Description, takes_robot
from dhkit.errors import MissingPackageError, ModelError
from dhkit.model.urdf import mechanics_urdf_text

if TYPE_CHECKING:
    import pinocchio

    PinocchioModel: TypeAlias = pinocchio.Model
else:
    PinocchioModel: TypeAlias = Any


class NoPinocchioError(MissingPackageError, ModelError):
    """Pinocchio is not installed; there is no wheel of it for Windows."""


def import_pinocchio() -> ModuleType:
    """Return the module pinocchio.

    Raises
    ------
    NoPinocchioError
        It cannot be imported; says where to get it.
    """
    try:
        import pinocchio
    except ImportError as error:
        raise NoPinocchioError(
            f"Pinocchio cannot be imported ({error}); pip install pin (Linux, macOS) or conda install pinocchio; "
            "everything that needs no reference model works without it"
        ) from None
    module: ModuleType = pinocchio
    return module


@takes_robot
def pinocchio_model(description: Description) -> PinocchioModel:
    """Return a Pinocchio model of a description, built from its URDF.

    Values that a URDF lacks are set on the model: gravity, ``armature`` (gear^2 rotor inertia, which rnea, crba and aba
    use; setting rotorInertia and rotorGearRatio alone would change nothing), dry friction by direction, unlimited
    effort and velocity as inf. A drive's inertia that two joints
    turn (``couplings``) has no place in a Pinocchio model: M lacks ``numbers.coupling``, tau ``numbers.coupling`` qdd.
    Joint i of the table is joint i of the model; frames ``dh0`` ... ``dhn`` and ``tool``.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    PinocchioModel
        A ``pinocchio.Model``, built anew by each call.

    Raises
    ------
    ModelError
        Pinocchio is not installed (there is no wheel of it for Windows), or refuses the model.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> model = pinocchio_model(library_robot("planar2r"))
    >>> model.nq, model.existFrame("tool")
    (2, True)
    """
    pin = import_pinocchio()
    text = mechanics_urdf_text(description)
    try:
        model = pin.buildModelFromXML(text)
    except ValueError as error:
        raise ModelError(f"{description.name}: Pinocchio refuses the URDF: {error}") from None
    numbers = description.numbers
    model.gravity.linear = numbers.gravity.copy()
    model.armature = numbers.armature.copy()
    model.damping = numbers.viscous.copy()
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = numbers.coulomb.T.copy()
    model.effortLimit = numbers.effort.copy()
    model.velocityLimit = numbers.velocity.copy()
    return model
