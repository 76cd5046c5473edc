from sympy import Basic, Number_

class ExprCondPair(Basic):
    def __init__(self, value: Number_, condition: Basic | bool) -> None: ...
