"""YAML without its traps: no aliases, no repeated keys, no objects; every refusal is one sentence."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import yaml

from modelgen.errors import ModelgenError, shortened


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML without aliases (a "billion laughs" cannot grow) and without repeated keys."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise ModelgenError("YAML aliases are not accepted; write the value out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[str] = set()
        if not isinstance(node, yaml.MappingNode):
            raise ModelgenError(
                f"is not valid YAML: {node.tag} stands before something else; take the tag out"
            )
        for key, _ in node.value:
            if str(key.value) in seen:
                line = key.start_mark.line + 1
                raise ModelgenError(
                    f"the key {shortened(str(key.value))} appears twice (line {line}); keep one"
                )
            seen.add(str(key.value))
        return super().construct_mapping(node, deep)


def read(path: Path, largest: int) -> bytes:
    """The first `largest` + 1 bytes of a regular file: a pipe would never end, nor would /dev/zero.

    Raises ModelgenError, whose sentence goes on after the file's name, and FileNotFoundError.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            kind = "a folder" if path.is_dir() else "a pipe or a device"
            raise ModelgenError(f"is {kind}; name a YAML text file")
        with path.open("rb") as stream:
            return stream.read(largest + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        reason = (error.strerror or "unknown").lower()
        raise ModelgenError(f"cannot be read ({reason}); name a readable YAML file") from None
    except ValueError:  # a null character in the path
        raise ModelgenError("is no path of a file; name a YAML text file") from None


def load(data: bytes) -> Any:
    """The value of a YAML text. Raises ModelgenError."""
    try:
        return yaml.load(data.decode("utf-8-sig"), Loader=_StrictLoader)
    except UnicodeDecodeError:
        raise ModelgenError("is not UTF-8 text; save it as a YAML text file") from None
    except RecursionError:
        raise ModelgenError("is nested too deeply; write it flat") from None
    except yaml.MarkedYAMLError as error:
        where = f" (line {error.problem_mark.line + 1})" if error.problem_mark else ""
        problem = shortened(str(error.problem or error), 100)
        raise ModelgenError(f"is not valid YAML{where}: {problem}; correct the syntax") from None
    except (yaml.YAMLError, ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        # the last four: PyYAML's own on a tag such as !!timestamp before a text that is none
        problem = shortened(str(error), 100)
        raise ModelgenError(f"is not valid YAML: {problem}; correct the syntax") from None
