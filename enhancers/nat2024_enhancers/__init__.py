"""Low-light enhancers, one module or package each; `nat2024.create_enhancer` makes them."""
