"""Places, motions and models as effects speak of them; they live beside the robots (geometry/place.py), where
a fit finds them without SymPy."""

from modelgen.geometry.place import (
    REVOLUTE_TRAVEL,
    SEEN,
    USUAL_SLIDE,
    Layout,
    Model,
    Motion,
    Place,
    PlaceSide,
    torque_slopes,
)

__all__ = [
    "REVOLUTE_TRAVEL",
    "SEEN",
    "USUAL_SLIDE",
    "Layout",
    "Model",
    "Motion",
    "Place",
    "PlaceSide",
    "torque_slopes",
]
