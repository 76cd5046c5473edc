"""One verb, one file: `run` does it and returns a record, `show` tells a person about the
record."""
