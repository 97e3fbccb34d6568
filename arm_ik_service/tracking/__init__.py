"""One hand or head in time: validity, order, glitches, hold and loss, smoothing."""
