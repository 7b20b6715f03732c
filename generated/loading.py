"""From a robot's name to a model that can be evaluated."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from generated.errors import GeneratedError
from generated.model import Model


def load(
    robot: str | Path, model: str = "A", payload: str | None = None, effects: tuple[str, ...] = ()
) -> Model:
    """The model `model` ("A", "B", "C" or "D") of a built-in robot or a robot file.

    `payload="L"` appends the ten parameters of that payload. Raises GeneratedError.
    """
    if effects:
        raise GeneratedError("effects are not part of a compiled model yet; leave effects=() here.")
    return _load(str(robot), model, payload)


@lru_cache(maxsize=32)
def _load(robot: str, model: str, payload: str | None) -> Model:
    from modelgen.description import derive
    from modelgen.errors import ModelgenError
    from modelgen.robot_file import load_robot

    try:
        derived = derive(load_robot(robot), model, payload)
    except ModelgenError as error:
        raise GeneratedError(str(error)) from None
    return Model(derived.description, derived.columns.evaluate)
