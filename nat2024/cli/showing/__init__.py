"""Pictures of `nat-bench show`: which runs and frames, strips and videos of them."""
