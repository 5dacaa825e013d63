"""One module a verb of `nat-bench`."""
