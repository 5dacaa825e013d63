"""`nat-bench new tracker`."""

from nat2024.cli.beginning import new_command

command = new_command("tracker")
