"""A study: which robot, which model, which recordings, how they are filtered (contract 3).

    robot: kuka_lwr4p
    model: A
    recordings:
      - {file: run1.parquet, use: identify}
      - {file: run2.parquet, use: validate}

`load_study` reads the YAML file and refuses what it does not know, with the key, the file and the remedy.
Paths are relative to the study file. `${NAME:-default}` in a path is the environment variable NAME, or the
default, so that a committed study finds recordings which are not committed.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    field_validator,
    model_validator,
)

from ident.errors import StudyError
from ident.recordings import effect_text, study_checks
from ident.recordings.fill_in import refuse_marks
from ident.signals.dry_friction import TurnOver
from modelgen.errors import ModelgenError, shortened
from modelgen.geometry import strict_yaml

Role = Literal["identify", "validate", "test"]
Effort = Literal["motor_torque", "motor_current", "joint_torque"]
ROLES: tuple[Role, ...] = ("identify", "validate", "test")
MODELS = ("A", "B", "C", "D")
ESTIMATORS = ("wls", "irls", "iv", "didim", "tls", "recursive")
LARGEST_FILE = 1_000_000
WITHOUT = ("coulomb_friction", "viscous_friction", "offset", "rotor_inertia")


Number = Annotated[float, BeforeValidator(study_checks.finite)]
Whole = Annotated[int, BeforeValidator(study_checks.whole)]
PathText = Annotated[str, AfterValidator(study_checks.path)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class ColumnMap(_Strict):
    """Where a signal stands in somebody's file: value = sign * scale * raw + offset (SI after that)."""

    column: str | Whole
    scale: Annotated[Number, AfterValidator(study_checks.scale)] = 1.0
    offset: Number = 0.0
    sign: Literal[1, -1] = 1


class RecordingEntry(_Strict):
    """One table and its use; `from`, `to` [s of its own time] cut a window, `payload` labels what is
    carried."""

    file: PathText
    use: Role = "identify"
    payload: Annotated[str | None, AfterValidator(study_checks.payload_label)] = None
    name: Annotated[str | None, AfterValidator(study_checks.name)] = None
    from_s: Number | None = Field(default=None, alias="from")
    to_s: Number | None = Field(default=None, alias="to")
    rate_hz: Annotated[Number, Field(ge=0.1, le=1e6)] | None = None  # only for tables without a time column
    decimal: Literal[".", ","] = "."  # only for CSV
    topic: str | None = None  # only for ROS bags with several joint states
    episode: Annotated[Whole, Field(ge=0)] | None = None  # only for tables of several episodes
    effort: Effort | None = None  # what a JointState's effort is; also for all recordings
    columns: dict[str, ColumnMap] = Field(default_factory=dict)
    _table: Any = PrivateAttr(default=None)  # in memory instead of `file` (ident.Recording); no key of a file

    @field_validator("columns", mode="before")
    @classmethod
    def _short_columns(cls, columns: Any) -> Any:
        return _expand_columns(columns)

    @model_validator(mode="after")
    def _window(self) -> RecordingEntry:
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError("to must come after from")
        return self

    @property
    def table(self) -> Any:
        """What `open_table` takes instead of a path, or None."""
        return self._table

    @property
    def label(self) -> str:
        return self.name or Path(self.file).stem + ("" if self.episode is None else f"_{self.episode}")


class FilterSettings(_Strict):
    """Cut-off frequencies [Hz] and orders of the two zero-phase Butterworth filters (paper 3.3).

    `position_cutoff_hz` (10; where the slowest recording is slower than 25 Hz and the study does not say, 0.4
    of its rate) smooths positions before they are differentiated, `decimation_cutoff_hz` is the
    parallel decimation of Y and of every column of W; `auto` chooses it by the Durbin-Watson rule.
    `sign_cutoff_hz` (default 4 x position) smooths the velocity whose sign Coulomb friction takes.
    `sign_velocity` [rad/s or m/s]: samples of a joint slower than this do not count in its fit; default:
    what the noise of its velocity asks for, 0: every sample counts, with the plain sign (see filtering.py).
    `path`: the positions along which what remembers them goes on (presliding, play): those of the `position`
    filter, or of the `sign` filter, which rounds a turn less.
    `resample_hz` is the uniform rate of jittered recordings (default: their own mean rate).
    """

    position_cutoff_hz: Annotated[Number, Field(ge=0.01, le=1e5)] = 10.0
    decimation_cutoff_hz: Annotated[Number, Field(ge=0.001, le=1e5)] | Literal["auto"] = "auto"
    sign_cutoff_hz: Annotated[Number, Field(ge=0.01, le=1e5)] | None = None
    sign_velocity: Annotated[Number, Field(ge=0, le=100)] | None = None
    path: Literal["position", "sign"] = "position"
    order: Annotated[Whole, Field(ge=1, le=8)] = 4
    resample_hz: Annotated[Number, Field(ge=0.1, le=1e5)] | None = None


class ControllerSettings(_Strict):
    """The loop that moved the robot, for `estimator: iv` and `didim`, which simulate it.

    `kind: pd`: u = kp (q_ref - q) + kd (dq_ref - dq), and an integral where `integral_hz` is given;
    `computed_torque`: the reference is followed as it is. Gains are `kp` [N m/rad] and `kd` [N m s/rad], one
    per joint, or follow from `bandwidth_hz` (one for all, or one per joint) and `damping`. `reference`: what
    columns of commanded positions are called before the joint's number or name.
    """

    kind: Literal["pd", "computed_torque"] = "pd"
    bandwidth_hz: tuple[Annotated[Number, Field(gt=0, le=1e4)], ...] = (10.0,)
    damping: Annotated[Number, Field(gt=0, le=100)] = 1.0
    integral_hz: Annotated[Number, Field(ge=0, le=1e4)] = 0.0
    kp: tuple[Annotated[Number, Field(gt=0)], ...] | None = None
    kd: tuple[Annotated[Number, Field(gt=0)], ...] | None = None
    reference: str = "q_ref"

    @field_validator("bandwidth_hz", mode="before")
    @classmethod
    def _one_for_all(cls, value: Any) -> Any:
        return value if isinstance(value, (list, tuple)) else (value,)

    @model_validator(mode="after")
    def _both(self) -> ControllerSettings:
        if (self.kp is None) != (self.kd is None) or (self.kp and self.kd and len(self.kp) != len(self.kd)):
            raise ValueError("kp and kd go together; give both, one number per joint, or bandwidth_hz")
        return self


class EffectEntry(BaseModel):
    """One effect that is part of the model that is fitted: where it stands, starts and fixed values.

    joint, source_joint: numbers as in the robot file; no joint: the whole robot. `from`, `to` [s since the
    recording's first sample] and `recording` bound a load. Other keys are its parameters: a start for
    what is searched, the value itself for what `fixed` lists. Also written NAME:JOINT[:key=value,...].
    """

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True)
    effect: str
    joint: Whole | None = None
    source_joint: Whole | None = None
    side: Literal["motor", "link", "sensor"] | None = None
    recording: str | None = None
    from_s: Number | None = Field(default=None, alias="from")
    to_s: Number | None = Field(default=None, alias="to")
    link: Whole | None = None
    fixed: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _values(self) -> EffectEntry:
        for name, value in self.given.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise ValueError(
                    f"{self.effect}: {name} is {value!r}; give a number (its start, or its value where fixed "
                    "lists it)"
                )
        for name in self.fixed:
            if name not in self.given:
                raise ValueError(f"{self.effect}: fixed lists {name}, which has no value; add {name}: NUMBER")
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"{self.effect}: to must come after from")
        return self

    @property
    def given(self) -> dict[str, float]:
        """Parameters with a start or a fixed value."""
        return dict(self.model_extra or {})


class Study(_Strict):
    """What is identified from which runs.

    Beside the keys of the contract: `exact: true` takes a URDF's angles and lengths as they are written
    (angles rounded beside a quarter turn then cost base parameters); `without` leaves terms out of the
    model; `link_inertia` gives each joint torque sensor an inertia of its own, Ial ddq_j; `coupled_drives`
    pairs joints whose motors a gearbox couples; `positions`, `stiffness` as in the paper's Appendix 2;
    `payload_mass` weighed payloads [kg]; `bounds`, `robust`, `reduction`, `reduction_alpha` (of the
    F-test), `effective_rows` choose the estimator; `controller` is the loop that iv and didim simulate (with
    wls it asks whether least squares is biased by feedback), `forgetting` what rows of `recursive` weigh
    less each 15 min of motion; `turn_over` [rad/s] and `presliding` [rad] per joint are
    the rate and the travel within which its dry friction changes sign, `instant_sign` whether its torque is
    recorded as it is at the sample, no mean over a drive's cycle; `trim_rest: false` keeps rest at the ends;
    `joints` are the joints' names in the recordings, in the robot's order; `effort` says what the
    driver records as such; `folder` is where the recordings are."""

    robot: PathText
    exact: bool = False
    model: Literal["A", "B", "C", "D"] = "A"
    recordings: tuple[RecordingEntry, ...]
    filter: FilterSettings = FilterSettings()
    drive_gains: Annotated[
        tuple[Number, ...] | Literal["identify"] | None, AfterValidator(study_checks.gains)
    ] = None
    columns: dict[str, ColumnMap] = Field(default_factory=dict)
    joints: tuple[str, ...] | None = None
    effort: Effort | None = None
    without: tuple[str, ...] = ()
    link_inertia: bool = False
    coupled_drives: tuple[tuple[Whole, Whole], ...] = ()
    positions: Literal["motor", "joint"] = "motor"
    stiffness: tuple[Number, ...] | None = None
    payload_mass: dict[str, Annotated[Number, Field(gt=0, le=1e5)]] = Field(default_factory=dict)
    bounds: Literal["physical"] | None = None
    robust: Literal["huber"] | None = None
    reduction: bool = True
    reduction_alpha: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    effective_rows: bool = True
    trim_rest: bool = True
    effects: tuple[EffectEntry, ...] = ()
    effects_folder: PathText | None = None
    gravity: Annotated[tuple[Number, Number, Number] | None, AfterValidator(study_checks.gravity)] = None
    channels: tuple[str, ...] | None = None
    estimator: Literal["wls", "irls", "iv", "didim", "tls", "recursive"] = "wls"
    forgetting: Annotated[Number, Field(gt=0, le=1)] | None = None
    controller: ControllerSettings | None = None
    alpha: Annotated[Number, Field(gt=0, lt=1)] = 0.01  # of the diagnosis
    turn_over: tuple[Annotated[Number, Field(ge=0)], ...] | None = None
    presliding: tuple[Annotated[Number, Field(ge=0)], ...] | None = None
    instant_sign: tuple[bool, ...] | None = None
    folder: PathText | None = None
    file: Path = Field(default=Path("study.yaml"), exclude=True)  # where it was read; not a key of the file

    @field_validator("columns", mode="before")
    @classmethod
    def _short_columns(cls, columns: Any) -> Any:
        return _expand_columns(columns)

    @field_validator("effects", mode="before")
    @classmethod
    def _short_effects(cls, effects: Any) -> Any:
        if not isinstance(effects, (list, tuple)):
            return effects
        return tuple(effect_text.keys_of(item) if isinstance(item, str) else item for item in effects)

    @field_validator("joints")
    @classmethod
    def _once(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        twice = next((name for name in names or () if (names or ()).count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"{twice} stands there twice; name each joint once, in the robot's order")
        return names

    @field_validator("channels")
    @classmethod
    def _some(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if names is not None and len(set(names)) < max(len(names), 1):
            raise ValueError("the list is empty or names a torque twice; list each torque once, as [tau_m1]")
        return names

    @field_validator("without")
    @classmethod
    def _known_terms(cls, terms: tuple[str, ...]) -> tuple[str, ...]:
        for term in terms:
            name, _, joint = term.partition(":")
            if name not in WITHOUT or (joint and not re.fullmatch("[1-9][0-9]{0,3}", joint)):
                raise ValueError(
                    f"{term!r} is not a term that can be left out{_did_you_mean(name, WITHOUT)}; "
                    f"the terms are {', '.join(WITHOUT)}, each also for one joint as {WITHOUT[0]}:2"
                )
        return terms

    @model_validator(mode="after")
    def _consistent(self) -> Study:
        if not self.recordings:
            raise ValueError("recordings: the list is empty; name at least one recording with use: identify")
        if not any(entry.use == "identify" for entry in self.recordings):
            raise ValueError("recordings: none has use: identify, so there is nothing to fit; mark one")
        labels = [entry.label for entry in self.recordings]
        for label in labels:
            if labels.count(label) > 1:
                raise ValueError(f"recordings: two of them are called {label}; give one of them a name: key")
        if self.positions == "joint" and self.stiffness is None:
            raise ValueError("stiffness: positions: joint needs it, one value per joint in N m/rad")
        if self.positions == "motor" and self.stiffness is not None:
            raise ValueError("stiffness: does nothing with positions: motor; leave it out, or write joint")
        if self.stiffness is not None and min(self.stiffness, default=0) <= 0:
            raise ValueError("stiffness: every value must be positive (N m/rad)")
        for number, entry in enumerate(self.recordings, 1):
            study_checks.columns_apart({**self.columns, **entry.columns}, f"recordings[{number}]")
        for label in self.payload_mass:
            if label not in {entry.payload for entry in self.recordings}:
                raise ValueError(f"payload_mass: no recording carries the payload {label}")
        study_checks.estimator(self)
        for number, effect in enumerate(self.effects, 1):
            if effect.recording is not None and effect.recording not in labels:
                raise ValueError(
                    f"effects[{number}]: no recording is called {effect.recording}; "
                    f"they are {', '.join(labels)}"
                )
        return self

    @property
    def path(self) -> Path:
        """The folder that the study's relative paths start from."""
        return self.file.parent

    def recording_path(self, entry: RecordingEntry) -> Path:
        folder = self.path / expand(self.folder) if self.folder else self.path
        return folder / expand(entry.file)

    @property
    def robot_source(self) -> str:
        """What `generated.load` takes: the path of a robot file beside the study, or a built-in name."""
        beside = self.path / expand(self.robot)
        try:
            return str(beside) if beside.is_file() else self.robot
        except OSError:  # a name longer than the file system allows
            return self.robot

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is legal but seldom meant, one sentence each."""
        return tuple(said for _, said in self.judged_again)

    @property
    def judged_again(self) -> tuple[tuple[str, str], ...]:
        """Recordings, by label, of which other roles have rows, too, and a sentence for each."""
        return study_checks.overlapping(self.recordings, ROLES)

    @property
    def turn_overs(self) -> tuple[TurnOver, ...]:
        """How the joints' dry friction changes sign, where the study says so."""
        if self.turn_over is None and self.presliding is None:
            return ()
        many = len(self.turn_over or self.presliding or ())
        plain, means = (0.0,) * many, (False,) * many
        each = zip(self.turn_over or plain, self.presliding or plain, self.instant_sign or means)
        return tuple(TurnOver(*its) for its in each)

    @property
    def payloads(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(entry.payload for entry in self.recordings if entry.payload))

    def with_(self, **changes: Any) -> Study:
        """The same study with some keys changed (checked again). Raises StudyError."""
        data = {name: getattr(self, name) for name in type(self).model_fields} | changes
        try:
            return Study(**data)
        except ValidationError as error:
            raise as_study_error(error, self.file) from None


def load_study(path: str | Path) -> Study:
    """Read a study file. Raises StudyError: one sentence with the file, the key and the remedy."""
    file = Path(path)
    try:
        data = strict_yaml.read(file, LARGEST_FILE)
        if len(data) > LARGEST_FILE:
            raise ModelgenError("is larger than 1 MB and so no study; name the YAML file, not a recording")
        table = strict_yaml.load(data)
    except FileNotFoundError:
        raise StudyError(
            shortened(str(file)), "", "there is no such file; give the path of a study (YAML)"
        ) from None
    except ModelgenError as error:
        raise StudyError(shortened(str(file), 200), "", str(error)) from None
    return study_from(table, file)


def study_from(data: Any, file: Path) -> Study:
    """A study from plain values as YAML gives them; `file` is what messages name and paths start from."""
    if not isinstance(data, dict):
        raise StudyError(
            str(file), "", "is not a table of keys; a study begins with robot:, model:, recordings:"
        )
    if "file" in data:
        raise StudyError(str(file), "file", "unknown key; did you mean recordings?")
    refuse_marks(data, file)
    try:
        return Study(**{str(key): value for key, value in data.items()}, file=file)
    except ValidationError as error:
        raise as_study_error(error, file) from None


def expand(text: str) -> str:
    """Replace ${NAME:-default} and ~ as a shell would."""

    def value(found: re.Match[str]) -> str:
        name, default = found[1], found[2]
        if (given := os.environ.get(name) or default) is None:
            raise StudyError(
                shortened(text),
                "",
                f"the environment variable {shortened(name)} is not set; set it, or write a default as "
                f"${{{shortened(name)}:-FOLDER}}",
            )
        return given

    return os.path.expanduser(re.sub(r"\$\{(\w+)(?::-([^}]*))?\}", value, text))


def _expand_columns(columns: Any) -> Any:
    """Allow `q1: position_1` and `q1: 3` for `q1: {column: ...}`, and `q1: {sign: -1}` of its own column."""
    if isinstance(columns, dict):
        return {
            str(key): {"column": value}
            if isinstance(value, (str, int))
            else {"column": str(key)} | value
            if isinstance(value, dict)
            else value
            for key, value in columns.items()
        }
    return columns


def _did_you_mean(name: str, known: tuple[str, ...] | list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f", did you mean {close[0]}?" if close else ""


def _known_keys(model: type[BaseModel]) -> list[str]:
    return [
        field.alias or name
        for name, field in model.model_fields.items()
        if name != "file" or model is not Study
    ]


def as_study_error(error: ValidationError, file: Path) -> StudyError:
    """The first complaint of pydantic as one sentence: key, problem, remedy."""
    first = error.errors()[0]
    unknown, loc = first["type"] == "extra_forbidden", first["loc"]
    tags = [isinstance(part, str) and ("[" in part or part in _TAGS) for part in loc]
    if unknown:
        tags[-1] = False  # a key that was given, whatever is in it
    where = [part for part, tag in zip(loc, tags) if not tag]
    key = ""
    for part in where:
        text = shortened(str(part))
        key += f"[{part + 1}]" if isinstance(part, int) else (f".{text}" if key else text)
    kind, given = first["type"], _Shown(first.get("input"))
    if unknown:
        owner: type[BaseModel] = Study
        for parent, model in (
            ("recordings", RecordingEntry),
            ("filter", FilterSettings),
            ("columns", ColumnMap),
            ("controller", ControllerSettings),
        ):
            owner = model if parent in where[:-1] else owner
        keys = _known_keys(owner)
        hint = _did_you_mean(shortened(str(where[-1])), keys) or f"; the keys are {', '.join(keys)}"
        problem = f"unknown key{hint}"
    elif kind != "value_error" and kind != "missing" and len(where) == 1 and str(where[0]) in _EXPECTED:
        problem = f"{given!r} does not fit; give {_EXPECTED[str(where[0])]}"
    elif key == "filter.decimation_cutoff_hz" and isinstance(given.value, str):
        problem = f"{given!r} does not fit; give a frequency in Hz or auto"
    elif kind == "missing":
        problem = "this key is missing; add it"
    elif kind == "literal_error":
        problem = f"{given!r} is not one of {first['ctx']['expected'].replace(' or ', ', ')}"
    elif kind == "value_error":
        problem = str(first["ctx"]["error"])
    elif kind in _KINDS:
        problem = f"{given!r} does not fit; give {_KINDS[kind]}"
    elif kind in _TABLES and (entries := [str(part) for part in where if str(part) in _ITEMS]):
        problem = f"{given!r} does not fit; give {_ITEMS[entries[-1]]}"
    else:
        problem = f"{given!r} does not fit: {first['msg'][0].lower()}{first['msg'][1:]}"
    problem = re.sub(r"\S{200,}", lambda word: shortened(word[0]), problem)  # names that were given
    return StudyError(shortened(str(file), 200), key, shortened(problem, 1000))


class _Shown:
    """A value as a sentence can hold it."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        try:
            return shortened(repr(self.value))
        except (ValueError, RecursionError):  # an integer of thousands of digits
            return "this value"


_KINDS = {  # pydantic's types of complaints: what is wanted
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text",
}
_TABLES = ("model_type", "dataclass_type", "dict_type", "model_attributes_type")
_ITEMS = {  # of such a key one entry
    "recordings": "{file: ..., use: ...}",
    "effects": "a name such as stribeck_friction:2, or {effect: torque_ripple, joint: 4}",
    "columns": "{q1: position_1} or {q1: {column: position_1, scale: 0.001}}",
}
_EXPECTED = {
    "joints": "a list such as [1, 2, 3]",
    "coupled_drives": "a list of pairs such as [[5, 6]]",
    "drive_gains": "a list of N m/A, one per joint, or identify",
    "recordings": "a list of {file: ..., use: ...}",
    "stiffness": "a list of N m/rad, one per joint",
    "without": "a list such as [coulomb_friction]",
    "filter": "{position_cutoff_hz: 10, decimation_cutoff_hz: 0.8}",
    "payload_mass": "{L: 4.6}",
    "effects": "a list such as [stribeck_friction:2, {effect: torque_ripple, joint: 4}]",
    "gravity": "three values in m/s^2 in the base frame, such as [0, 0, -9.81]",
    "channels": "a list such as [tau_m1, tau_m2]",
    "turn_over": "a list of rad/s, one per joint",
    "presliding": "a list of rad, one per joint",
    "instant_sign": "a list of true or false, one per joint",
    "controller": "{bandwidth_hz: 10, damping: 1} or {kp: [...], kd: [...]}",
}
_TAGS = {"float", "int", "str", "tuple", "list", "function-before"}
