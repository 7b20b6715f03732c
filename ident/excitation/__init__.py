"""Experiments that answer: motions that excite every parameter, and motions that tell two effects apart."""
