"""What notebooks of the site print: no file of the kernel in warnings, no moving line of progress from commands."""

import os
import warnings

warnings.formatwarning = lambda message, category, *_, **__: f"{category.__name__}: {message}\n"
os.environ["TERM"] = "dumb"
