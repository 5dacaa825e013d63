"""`nat-bench new enhancer`."""

from nat2024.cli.beginning import new_command

command = new_command("enhancer")
