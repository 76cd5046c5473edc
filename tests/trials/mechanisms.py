"""Random mechanisms through the front door."""


def tried_all(record, count):
    pass
