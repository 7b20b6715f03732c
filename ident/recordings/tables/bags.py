"""ROS 1 bags, ROS 2 bags (sqlite3, MCAP) as tables: one topic's joints, one message a row.

The topic is chosen by what its messages hold: effort first, then the most joints; two that are equal are
asked for (`topic:`). `t` is the header's stamp, or the time of receipt where drivers leave stamps empty, in
seconds since the first. Messages are read one after the other; the first reading leaves its numbers in an
unnamed temporary file, which later readings use.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ident.errors import RecordingError
from ident.recordings.tables import table as of
from ident.recordings.tables.joint_messages import DEFINITIONS, READERS
from ident.recordings.tables.table import Blocks, Table

LOOK = 200  # messages of a topic that tell which joints it speaks of
LATE = 64  # messages that may come out of order
ENDINGS = (".bag", ".mcap", ".db3")


@dataclass(frozen=True, slots=True)
class Stream:
    """The messages of one topic that speak of the same joints."""

    topic: str
    msgtype: str
    joints: tuple[str, ...]
    kinds: tuple[str, ...]  # position, velocity, effort ...
    stamped: bool

    @property
    def columns(self) -> tuple[str, ...]:
        return ("t", *(f"{kind}.{joint}" for kind in self.kinds for joint in self.joints))

    @property
    def rank(self) -> tuple[bool, bool, int, int]:
        kind = -list(READERS).index(self.msgtype)
        return "position" in self.kinds, "effort" in self.kinds, len(self.joints), kind


def bag_files(path: Path) -> list[Path]:
    """The parts of a bag: a file, a folder with its metadata, a folder of parts, a pattern. [] for no bag."""
    if any(mark in path.name for mark in "*?["):
        return sorted(part for part in path.parent.glob(path.name) if part.suffix in ENDINGS)
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return [path]
        parts = [sorted(path.glob(f"*{ending}")) for ending in ENDINGS]
        return next((found for found in parts if found), [])
    return [path] if path.suffix in ENDINGS else []


def bag(file: str, parts: Sequence[Path], topic: str | None = None) -> Table:
    """A bag's joints as a table. Raises RecordingError where it has none, or several that are equal."""
    stream, remarks = _chosen(file, parts, topic)
    columns = stream.columns
    spool = _Spool(len(columns))

    def read(names: Sequence[str]) -> Blocks:
        picks = [columns.index(name) for name in names]
        blocks = spool.blocks() if spool.file is not None else spool.filled(_blocks(file, parts, stream))
        for block in blocks:
            yield block[:, picks]

    return Table(file, columns, True, read, remarks=remarks)


@contextlib.contextmanager
def _opened(file: str, parts: Sequence[Path]) -> Iterator[tuple[list[Any], Any]]:
    """Readers of the parts in the order of their times, and a function (connection, raw) -> message."""
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    except ImportError:
        raise RecordingError(file, "is a ROS bag; pip install 'dynident[ros]' to read it") from None
    with contextlib.ExitStack() as stack:
        first = parts[0].suffix == ".bag"
        readers = [stack.enter_context((rosbag1 if first else rosbag2).Reader(part)) for part in parts]
        readers.sort(key=lambda reader: reader.start_time)
        types: dict[str, Any] = {}
        joints = [c for reader in readers for c in reader.connections if c.msgtype in READERS]
        if not all(connection.msgdef.data for connection in joints):
            types |= get_typestore(Stores.ROS1_NOETIC if first else Stores.LATEST).fielddefs
            for name, text in DEFINITIONS.items():
                types |= get_types_from_msg(text, name)
        for connection in joints:
            text, kind = connection.msgdef.data, connection.msgdef.format.name
            if text:
                types |= (
                    get_types_from_idl(text)
                    if kind == "IDL"
                    else get_types_from_msg(text, connection.msgtype)
                )
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        deserialize = store.deserialize_ros1 if first else store.deserialize_cdr
        yield readers, lambda connection, raw: deserialize(raw, connection.msgtype)


def _chosen(file: str, parts: Sequence[Path], topic: str | None) -> tuple[Stream, tuple[str, ...]]:
    """The stream to read, and a remark on the others."""
    streams: dict[tuple[str, frozenset[str]], Stream] = {}
    with _opened(file, parts) as (readers, message_of):
        present = {c.topic: c.msgtype for reader in readers for c in reader.connections}
        for reader in readers:
            for connection in reader.connections:
                if connection.msgtype not in READERS or (topic is not None and connection.topic != topic):
                    continue
                for _, _, raw in itertools.islice(reader.messages([connection]), LOOK):
                    message = message_of(connection, raw)
                    names, found = READERS[connection.msgtype](message)
                    twice = next((name for name in names if names.count(name) > 1), None)
                    if twice is not None:
                        raise RecordingError(
                            file,
                            f"{connection.topic} names the joint {twice} twice in one message; rename one",
                        )
                    key = (connection.topic, frozenset(names))
                    if names and found and key not in streams:
                        stamp = message.header.stamp
                        streams[key] = Stream(
                            connection.topic,
                            connection.msgtype,
                            tuple(names),
                            tuple(kind for kind, values in found.items() if len(values) == len(names)),
                            bool(stamp.sec or stamp.nanosec),
                        )
    if topic is not None and topic not in present:
        raise RecordingError(file, f"has no topic {topic}; its topics are {_listed(sorted(present))}")
    if not streams:
        shown = _listed([f"{name} ({kind})" for name, kind in sorted(present.items())]) or "none"
        raise RecordingError(
            file,
            "holds no joint states (sensor_msgs/JointState, control_msgs/JointTrajectoryControllerState or "
            f"DynamicJointState) to read; record their topic; its topics are {shown}",
        )
    ranked = sorted(streams.values(), key=lambda stream: stream.rank, reverse=True)
    best, others = ranked[0], ranked[1:]
    equal = [stream.topic for stream in others if stream.rank == best.rank and stream.topic != best.topic]
    if equal:
        raise RecordingError(
            file,
            f"has joint states on {_listed([best.topic, *equal])}; say which with topic: beside the file",
        )
    remarks = [f"joints read from {best.topic} ({best.msgtype.replace('/msg/', '/')})"]
    if others:
        remarks[0] += f", not from {_listed([f'{s.topic} ({len(s.joints)} joints)' for s in others])}"
    if not best.stamped:
        remarks.append("its stamps are empty, so the times of receipt are used")
    return best, tuple(remarks)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def _blocks(file: str, parts: Sequence[Path], stream: Stream) -> Blocks:
    """(rows, columns) of a stream, t first."""
    rows = _in_order(_rows(file, parts, stream))
    first: int | None = None
    while taken := list(itertools.islice(rows, of.ROWS)):
        first = taken[0][0] if first is None else first
        t = np.array([stamp for stamp, _, _ in taken], np.int64) - first
        yield np.column_stack([t / 1e9, np.array([values for _, _, values in taken])])


def _rows(file: str, parts: Sequence[Path], stream: Stream) -> Iterator[tuple[int, int, np.ndarray]]:
    """(stamp in ns, number, values in the order of the stream's columns) of every message."""
    number = itertools.count()
    orders: dict[tuple[str, ...], np.ndarray | None] = {}
    read = READERS[stream.msgtype]
    with _opened(file, parts) as (readers, message_of):
        for reader in readers:
            wanted = (stream.topic, stream.msgtype)
            connections = [c for c in reader.connections if (c.topic, c.msgtype) == wanted]
            if not connections:
                continue
            for connection, received, raw in reader.messages(connections):
                message = message_of(connection, raw)
                names, found = read(message)
                key = tuple(names)
                if key not in orders:
                    inside = set(stream.joints) <= set(names)
                    orders[key] = np.array([names.index(name) for name in stream.joints]) if inside else None
                order = orders[key]
                if order is None:
                    continue
                stamp = message.header.stamp
                at = stamp.sec * 10**9 + stamp.nanosec if stream.stamped else received
                values = np.full((len(stream.kinds), len(order)), np.nan)
                for k, kind in enumerate(stream.kinds):
                    if len(found.get(kind, ())) == len(names):
                        values[k] = found[kind][order]
                yield at, next(number), values.ravel()


def _in_order(rows: Iterator[tuple[int, int, np.ndarray]]) -> Iterator[tuple[int, int, np.ndarray]]:
    """Rows by their stamps where a few of them arrived too late."""
    waiting: list[tuple[int, int, np.ndarray]] = []
    for row in rows:
        if len(waiting) < LATE:
            heapq.heappush(waiting, row)
        else:
            yield heapq.heappushpop(waiting, row)
    while waiting:
        yield heapq.heappop(waiting)


class _Spool:
    """Numbers of a bag in an unnamed temporary file, after they were read once to the end."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.file: Any = None

    def filled(self, blocks: Blocks) -> Blocks:
        """The blocks as they come, kept on the way; a full disk only means that nothing is kept."""
        with contextlib.ExitStack() as unless_kept:
            file: Any = None
            with contextlib.suppress(OSError):
                file = unless_kept.enter_context(tempfile.TemporaryFile())
            for block in blocks:
                try:
                    if file is not None:
                        file.write(np.ascontiguousarray(block).data)
                except OSError:
                    file = None
                yield block
            if file is not None:
                unless_kept.pop_all()
                self.file = file
                weakref.finalize(self, file.close)

    def blocks(self) -> Blocks:
        """From the temporary file; readers may take turns."""
        position, size = 0, of.ROWS * self.width * 8
        while True:
            self.file.seek(position)
            data = self.file.read(size)
            if not data:
                return
            position += len(data)
            yield np.frombuffer(data).reshape(-1, self.width)
