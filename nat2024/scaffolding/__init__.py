"""Writing the first form of a plugin package: complete, installable and tested.

The files under `templates` are texts with `$name`-like fields; their ending `.template` keeps
tools from taking them for code of this project.
"""

from nat2024.scaffolding.packages import write_plugin_package

__all__ = ["write_plugin_package"]
