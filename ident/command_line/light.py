"""The door, as the commands use it: without what none of them needs.

SciPy takes in all that NumPy names, with f2py a Fortran parser and a guesser of encodings: 60 ms and 7 MB. A
name that is there is not looked up; who imports numpy.f2py gets it as ever.
"""

from types import ModuleType

import numpy as np

import ident as ident

np.f2py = ModuleType("numpy.f2py")  # type: ignore[attr-defined]
