"""The commands of the command line; `cli` reads their options."""
