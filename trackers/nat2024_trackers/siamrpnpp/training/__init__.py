"""Training of SiamRPN++: pairs of crops, the anchors they belong to, the loss."""
