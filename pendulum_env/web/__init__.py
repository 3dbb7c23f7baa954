"""A page for the browser that computes the same bits as Python; see README.md beside this file."""

from __future__ import annotations

from pendulum_env.engine.javascript import javascript
from pendulum_env.web.links import read_link
from pendulum_env.web.page import page, write

__all__ = ["javascript", "page", "read_link", "write"]
