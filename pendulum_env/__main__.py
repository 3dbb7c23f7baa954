"""Entry point of ``python -m pendulum_env``, which runs ``lab-pendulum``."""

from __future__ import annotations

import sys

from pendulum_env.cli import NAME, main

if __name__ == "__main__":
    sys.argv[0] = NAME
    main()
