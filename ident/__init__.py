"""Identification of robots on top of the compiled regressor: fit, diagnose, simulate, report.

    import ident
    study = ident.load("study.yaml")    # or ident.Study(robot=..., recordings=[ident.Recording(df), ...])
    fit = ident.fit(study)
    found = ident.diagnose(study)
    twin = ident.simulate("kuka_lwr4p", effects=["stribeck_friction:4"], seed=0)

Importing this takes no time: each name is imported when it is first used. Errors are `ident.Error` and its
subclasses, whose text is the sentence that the command prints. Symbols, their names in code and their units:
the table at the end of README.md.
"""

TYPE_CHECKING = False  # typing's own costs 5 ms, in which Ctrl-C would find nobody at home
if TYPE_CHECKING:
    from typing import Any

    from ident.api.comparison import Comparison, compare
    from ident.api.diagnosis import Diagnosis, diagnose
    from ident.api.fit import Fit, fit
    from ident.api.simulation import Simulation, simulate
    from ident.api.study import Recording, Study, load
    from ident.errors import IdentError as Error
    from modelgen.effects import register

_HOMES = {
    "Comparison": ("ident.api.comparison", "Comparison"),
    "Diagnosis": ("ident.api.diagnosis", "Diagnosis"),
    "Error": ("ident.errors", "IdentError"),
    "Fit": ("ident.api.fit", "Fit"),
    "Recording": ("ident.api.study", "Recording"),
    "Simulation": ("ident.api.simulation", "Simulation"),
    "Study": ("ident.api.study", "Study"),
    "compare": ("ident.api.comparison", "compare"),
    "diagnose": ("ident.api.diagnosis", "diagnose"),
    "fit": ("ident.api.fit", "fit"),
    "load": ("ident.api.study", "load"),
    "register": ("modelgen.effects", "register"),
    "simulate": ("ident.api.simulation", "simulate"),
}
__all__ = [
    "Comparison",
    "Diagnosis",
    "Error",
    "Fit",
    "Recording",
    "Simulation",
    "Study",
    "compare",
    "diagnose",
    "fit",
    "load",
    "register",
    "simulate",
]


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module 'ident' has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _HOMES[name]
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
