"""The trackers that nat-bench brings along, one sub-package each."""
