"""EnlightenGAN: a generator with self-attention, trained without pairs (TIP 2021)."""
