"""Parts that the other modules share and no user opens."""
