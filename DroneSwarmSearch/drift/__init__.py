"""Where a missing person may be, and why: forecasts, the sampler, the belief."""
