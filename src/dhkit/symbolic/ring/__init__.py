"""The exact ring: polynomials in sines, cosines and parameters, in a normal form that decides equality."""

from dhkit.symbolic.ring.constants import Constants, value_of
from dhkit.symbolic.ring.elements import Element, Elements, Generator, RingError, element_array
from dhkit.symbolic.ring.polynomials import Monomial
from dhkit.symbolic.ring.reading import Direction
from dhkit.symbolic.ring.ring import Constant, Ring, angle_name, translated

__all__ = [
    "Constant",
    "Constants",
    "Direction",
    "Element",
    "Elements",
    "Generator",
    "Monomial",
    "Ring",
    "RingError",
    "angle_name",
    "element_array",
    "translated",
    "value_of",
]
