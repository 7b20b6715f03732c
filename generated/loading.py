"""From a robot's name to a model that can be evaluated: committed C, or derived once and cached."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
import os
import re
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from generated import cache, compiling
from generated.errors import GeneratedError
from generated.kernel import Kernel
from generated.model import Model

HERE = Path(__file__).parent
MODELS = ("A", "B", "C", "D")
LARGEST_GRAVITY = 1e3  # m/s^2
LARGEST_FILE = 1 << 24  # bytes of a robot file that are read; the reader of each kind bounds it further
_lock = threading.RLock()
_loaded: dict[Question, Model] = {}


@dataclass(frozen=True, slots=True)
class Question:
    """Which model is asked for: `data` is the robot file's content, `gravity` None where it is the file's."""

    name: str  # built-in name or path
    data: bytes
    model: str
    payload: str | None = None
    effects: tuple[str, ...] = ()
    gravity: tuple[float, float, float] | None = None
    own_effects: str = ""  # fingerprint of those among the effects that a user registered
    exact: bool = False  # a URDF's angles and lengths as they are written


def _after_fork() -> None:
    global _lock
    _lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def load(
    robot: str | os.PathLike[str],
    model: str = "A",
    payload: str | None = None,
    effects: Sequence[str] = (),
    gravity: Sequence[float] | None = None,
    exact: bool = False,
) -> Model:
    """The model "A", "B", "C" or "D" of a built-in robot or of a robot file.

    `payload="L"` appends the ten parameters of that payload, `effects=("stribeck_friction:2",)` an effect's
    columns; `gravity=(x, y, z)`, m/s^2 in the base frame, replaces the robot file's; `exact` keeps a
    URDF's angles and lengths as they are written. What is not built in is derived, compiled and cached on
    first use. Raises GeneratedError.
    """
    if model not in MODELS:
        raise GeneratedError(f"there is no model {model!r}; choose A, B, C or D.")
    if not isinstance(payload, str | None):
        raise GeneratedError(f"the payload is {payload!r}; give its label as text, for example 'L'.")
    effects = _effects(effects)
    given = (*_robot_file(robot), model, payload, effects, _gravity(gravity), _own(effects))
    question = Question(*given, bool(exact))
    with _lock:
        found = _loaded.get(question)
        if found is None:
            found = _loaded[question] = _load(question)
        return found


def _own(effects: tuple[str, ...]) -> str:
    if not effects:
        return ""
    from modelgen.effects import fingerprint

    return fingerprint(effects)


def _effects(given: Any) -> tuple[str, ...]:
    try:
        effects = (given,) if isinstance(given, str) else tuple(given)
    except TypeError:
        effects = (given,)
    for effect in effects:
        if not isinstance(effect, str):
            raise GeneratedError(f"the effect {effect!r} is no text; give for example 'stribeck_friction:2'.")
    return effects


def _gravity(given: Any) -> tuple[float, float, float] | None:
    """Three finite numbers; what rounding leaves of a zero is zero, so that it costs no parameters."""
    if given is None:
        return None
    try:
        x, y, z = (float(value) for value in given)
    except (TypeError, ValueError):
        x = y = z = math.nan
    size = math.sqrt(x * x + y * y + z * z)
    if not size <= LARGEST_GRAVITY:
        raise GeneratedError(
            f"gravity is {given!r}; give three numbers in m/s^2 in the base frame, for example (0, 0, -9.81)."
        )
    x, y, z = (0.0 if abs(value) <= 1e-12 * size else value for value in (x, y, z))
    return x, y, z


def _robot_file(robot: str | os.PathLike[str]) -> tuple[str, bytes]:
    """(built-in name or path, content)."""
    text = str(robot) if isinstance(robot, str | os.PathLike) else ""
    if not text:
        raise GeneratedError(f"{robot!r} is no robot; give a built-in name or the path of a robot file.")
    path = Path(text)
    built_in = {p.stem: p for p in (_modelgen() / "robots").iterdir() if p.suffix in (".yaml", ".urdf")}
    if text in built_in and not path.is_file():
        return text, built_in[text].read_bytes()
    try:
        if not path.is_file():
            raise OSError
        with path.open("rb") as stream:
            return text, stream.read(LARGEST_FILE)
    except (OSError, ValueError):  # ValueError: a null character in the path
        names = ", ".join(sorted(built_in))
        shown = text if len(text) < 200 else f"{text[:200]} ..."
        raise GeneratedError(
            f"{shown} is neither a readable robot file nor a built-in robot; built in are {names}."
        ) from None


@lru_cache(maxsize=1)
def _modelgen() -> Path:
    spec = importlib.util.find_spec("modelgen")  # finds it without importing what it needs
    assert spec is not None and spec.submodule_search_locations
    return Path(next(iter(spec.submodule_search_locations)))


def _load(question: Question) -> Model:
    with _first_use(f"{Path(question.name).stem}, model {question.model}") as progress:
        files = _committed(question)
        if files is None:
            progress("derived")
            files = _derived(question)
        description, code = files
        progress("compiled")
        try:
            kernel: Any = Kernel(compiling.library(description, code), description["columns"])
        except (compiling.NoCompilerError, OSError) as error:
            warnings.warn(
                f"No C compiler works here ({error}); {description['robot']} is evaluated by NumPy, some ten "
                "times slower: install gcc or clang, or pip install 'dynident[compiler]'.",
                stacklevel=4,
            )
            kernel = _numpy_kernel(question)
    q = question
    again = (load, (q.name, q.model, q.payload, q.effects, q.gravity, q.exact))
    return Model(description, kernel, again, lambda: _casadi(question))


def _committed(question: Question) -> tuple[Mapping[str, Any], str] | None:
    """Description and C that came with the package, if they are of this very robot file."""
    name, model, payload = question.name, question.model, question.payload
    if question.effects or question.gravity is not None:
        return None
    stem = model if payload is None or model == "D" else f"{model}_{payload}"
    place = HERE / name / stem
    if not re.fullmatch(r"[A-Za-z0-9_]+", name) or not place.with_suffix(".json").is_file():
        return None
    description = json.loads(place.with_suffix(".json").read_text(encoding="utf-8"))
    content = question.data.replace(b"\r\n", b"\n")
    if description["made_of"]["robot_sha256"] != hashlib.sha256(content).hexdigest():
        return None
    return description, place.with_suffix(".c").read_text(encoding="utf-8")


def _derived(question: Question) -> tuple[Mapping[str, Any], str]:
    """Description and C of any robot, from the cache or made now."""

    def build(place: Path) -> None:
        from modelgen.emit import c_code

        derived, robot = _derive(question)
        made_of = c_code.provenance(robot.source_sha256)
        (place / "model.json").write_text(json.dumps(c_code.described(derived, made_of)), encoding="utf-8")
        (place / "model.c").write_text(c_code.source(derived, made_of), encoding="utf-8")

    q = question
    asked: tuple[bytes | str, ...] = (
        q.data,
        q.model,
        repr(q.payload),
        repr(q.gravity),
        *q.effects,
        q.own_effects,
        *(["exact"] if q.exact else []),
    )
    place = cache.entry("model-" + cache.key(*asked, _generator())[:40], build)
    return json.loads((place / "model.json").read_text(encoding="utf-8")), (place / "model.c").read_text(
        encoding="utf-8"
    )


@lru_cache(maxsize=1)
def _generator() -> str:
    """The generator's own content: a cache entry made by another version is not used."""
    parts = [p for p in sorted(_modelgen().rglob("*.py")) if p.is_file()]
    return cache.key(*(p.read_bytes() for p in parts))


def _derive(question: Question) -> Any:
    from modelgen.emit.description import derive
    from modelgen.errors import ModelgenError
    from modelgen.geometry.robot_file import parse_robot

    try:
        robot = parse_robot(question.data, Path(question.name).name, question.exact)
        if question.gravity is not None:
            robot = robot.with_gravity(question.gravity)
        return derive(robot, question.model, question.payload, question.effects), robot
    except ModelgenError as error:
        raise GeneratedError(str(error)) from None


@lru_cache(maxsize=16)
def _casadi(question: Question) -> Mapping[str, Any]:
    derived, _ = _derive(question)
    from modelgen.emit.casadi_functions import outer_functions

    return outer_functions(derived)


def _numpy_kernel(question: Question) -> Any:
    from generated.numpy_kernel import NumpyKernel

    return NumpyKernel(_derive(question)[0])


@contextmanager
def _first_use(what: str) -> Iterator[Any]:
    """On a terminal, say what takes time on first use."""
    steps: list[str] = []
    start = time.monotonic()
    finished = threading.Event()

    def speak() -> None:
        if not finished.wait(0.5):
            print(
                f"{what}: being {steps[-1] if steps else 'made'} on first use ...",
                end="",
                file=sys.stderr,
                flush=True,
            )
            steps.append("spoken")

    if not sys.stderr.isatty():
        yield steps.append
        return
    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield steps.append
    finally:
        finished.set()
        speaker.join()
        if "spoken" in steps:
            print(f" {time.monotonic() - start:.1f} s", file=sys.stderr)
