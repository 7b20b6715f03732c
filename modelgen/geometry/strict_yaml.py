"""YAML without its traps: no aliases, no repeated keys, no objects; every refusal is one sentence."""

from __future__ import annotations

from typing import Any

import yaml

from modelgen.errors import ModelgenError


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML without aliases (a "billion laughs" cannot grow) and without repeated keys."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise ModelgenError("YAML aliases are not accepted; write the value out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[str] = set()
        for key, _ in node.value:
            if str(key.value) in seen:
                line = key.start_mark.line + 1
                raise ModelgenError(f"the key {key.value} appears twice (line {line}); keep one")
            seen.add(str(key.value))
        return super().construct_mapping(node, deep)


def load(data: bytes) -> Any:
    """The value of a YAML text. Raises ModelgenError."""
    try:
        return yaml.load(data.decode(), Loader=_StrictLoader)
    except UnicodeDecodeError:
        raise ModelgenError("is not UTF-8 text; save it as a YAML text file") from None
    except RecursionError:
        raise ModelgenError("is nested too deeply; a robot file is a flat table") from None
    except yaml.MarkedYAMLError as error:
        where = f" (line {error.problem_mark.line + 1})" if error.problem_mark else ""
        raise ModelgenError(
            f"is not valid YAML{where}: {error.problem or error}; correct the syntax"
        ) from None
    except (yaml.YAMLError, ValueError) as error:
        raise ModelgenError(
            f"is not valid YAML: {' '.join(str(error).split())}; correct the syntax"
        ) from None
