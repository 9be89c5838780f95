"""Upper bounds on the success of any policy."""
