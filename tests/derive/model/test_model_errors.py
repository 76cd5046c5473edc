"""One model file per error: where it points, what it says, what it expected, and what it thinks was
meant.

The mark « stands before the place that the message must point at; it is taken out before the text
is read.

Of derive.model: collisions, document, limits, reader.
Of derive.model.language: kinds, shape.
"""

import json
import os
import re
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from derive.diagnostics import (
    AssumptionError,
    Diagnostic,
    HamelError,
    ModelError,
    ToolchainError,
    VerificationError,
    nearest,
)
from derive.model import Model, load, load_text
from derive.robots.reading import load as load_any

MODELS = sorted((Path(__file__).parents[3] / "models").rglob("*.yaml"))

BAR = "model: bar\nplane: xy\nparameters: {m: 1 kg, l: 1 m}\n"
BODY = "bodies: {b: {mass: m, com: [l/2, 0], inertia: m*l^2/12}}\n"
JOINT = "joints: {A: {type: revolute, parent: ground, child: b, coordinate: q}}\n"
ARM = BAR + BODY + JOINT
SPACE = (
    ARM.replace("plane: xy\n", "")
    .replace("com: [l/2, 0]", "com: [l/2, 0, 0]")
    .replace("child: b", "child: b, axis: z")
)
PAIR = BAR + "bodies: {a: {mass: m}, b: {mass: m}}\n"
POINT = "model: point\ncoordinates: {x: m, y: m}\nparameters: {m: 1 kg, l: 1 m}\nkinetic: m/2*(der(x)^2 + der(y)^2)\n"
GROUND_A = "A: {type: revolute, parent: ground, child: a}"
GROUND_B = "B: {type: revolute, parent: ground, child: b}"
TREE = PAIR + f"joints: {{{GROUND_A}, {GROUND_B}}}\n"

# id, text, message, expected, hint
ERRORS = [
    # the file
    ("empty", "«", "the file is empty", "model: a_name", ""),
    ("only_comment", "«# nothing\n", "the file is empty", "model: a_name", ""),
    (
        "list_at_top",
        "«- model: x\n",
        "a list at the top",
        "a mapping that starts with `model: a_name`",
        "",
    ),
    ("text_at_top", "«just text\n", "text at the top", "a mapping", ""),
    (
        "yaml_syntax",
        "model: {a: 1\nb«: 2\n",
        "not valid YAML: did not find expected ',' or '}'",
        "',' or '}'",
        "",
    ),
    (
        "colon_in_text",
        "model: a\ndescription: see«: here\n",
        "not valid YAML: mapping values are not allowed",
        "quotes",
        "",
    ),
    ("tab", "model: a\nbodies:\n«\tb: {mass: 1}\n", "a tab in the indentation", "spaces", ""),
    (
        "duplicate_key",
        "model: a\n«model: b\n",
        "'model' is given twice; first on line 1, column 1",
        "one of the two",
        "",
    ),
    (
        "duplicate_inner",
        "model: a\nparameters: {l: 1, m: 1, «l: 2}\n",
        "'l' is given twice; first on line 2, column 14",
        "",
        "",
    ),
    ("alias", "model: &a x\ndescription: «*a\n", "an alias '*a'", "the value itself", ""),
    ("tag", "model: «!!python/name:os.system x\n", "a tag", "a plain value", ""),
    ("merge_key", "model: a\n«<<: {b: 1}\n", "unknown key '<<'", "model", ""),
    (
        "second_document",
        "model: a\n«---\nmodel: b\n",
        "a second document",
        "one model per file",
        "",
    ),
    (
        "mapping_as_key",
        "model: a\n? «[1, 2]\n: 3\n",
        "a list or a mapping as a key",
        "stands in quotes",
        "",
    ),
    ("deep", "model: " + "[" * 32 + "«[", "the file is nested too deeply", "at most 32 levels", ""),
    (
        "control_character",
        "model: a\ndescription: be«\x07ll\n",
        "the control character '\\x07'",
        "printable text",
        "",
    ),
    (
        "escaped_control",
        'model: a\ndescription: «"be\\all"\n',
        "the control character '\\x07' in a text",
        "printable text",
        "",
    ),
    # shape
    (
        "unknown_section",
        "model: a\n«bodys: {}\n",
        "unknown key 'bodys'",
        "bodies",
        "did you mean 'bodies'?",
    ),
    (
        "unknown_key",
        BAR + "bodies: {b: {mass: m, «intertia: 1}}\n",
        "unknown key 'intertia'",
        "mass, com, first_moment, inertia",
        "'inertia'",
    ),
    ("missing_name", "«plane: xy\n", "the model has no 'model'", "the key 'model'", ""),
    (
        "missing_key",
        BAR + "bodies: {«b: {com: [0, 0]}}\n",
        "'b' has no 'mass'",
        "the key 'mass'",
        "",
    ),
    ("section_is_text", "model: a\nbodies: «none\n", "text under 'bodies'", "a mapping", ""),
    ("section_is_nothing", "model: a\njoints:«\n", "nothing under 'joints'", "a mapping", ""),
    (
        "body_is_text",
        "model: a\nbodies: {b: «heavy}\n",
        "text under 'b'",
        "a mapping with mass, com",
        "",
    ),
    (
        "formula_is_list",
        BAR + "bodies: {b: {mass: «[m]}}\n",
        "a list under 'mass'",
        "a text or a number",
        "",
    ),
    ("name_is_list", "model: «[a]\n", "a list under 'model'", "a text or a number", ""),
    ("unknown_plane", "model: a\nplane: «xw\n", "unknown plane 'xw'", "xy, xz or yz", ""),
    ("plane_is_list", "model: a\nplane: «[x, y]\n", "a list under 'plane'", "xy, xz or yz", ""),
    (
        "rate_as_others_write_it",
        ARM + "loads: {d: {type: expression, joint: A, expression: «dq}}\n",
        "unknown name 'dq'",
        "q, t",
        "did you mean 'der(q)'?",
    ),
    (
        "rate_of_what_starts_with_a_d",
        ARM.replace("coordinate: q", "coordinate: dist")
        + "loads: {d: {type: expression, joint: A, expression: «dist_dot}}\n",
        "unknown name 'dist_dot'",
        "dist, t",
        "did you mean 'der(dist)'?",
    ),
    (
        "quote_without_an_end",
        "model: a\ndescription: 'of an arm\n«",
        "not valid YAML: found unexpected end of stream (while scanning a quoted scalar that starts on line 2)",
        "a quote at the end of the text, of the kind it starts with",
        "",
    ),
    (
        "gravity_is_number",
        "model: a\ngravity: «9.81\n",
        "a number under 'gravity'",
        "a list in [ ] of its components: [0, 0, -9.81], or [0, -9.81] in a plane",
        "",
    ),
    (
        "one_point_for_two",
        ARM + "closures: {C: {type: revolute, between: [b, ground], at: [«0, 0]}}\n",
        "a number in the list under 'at'",
        "[[…], […]]",
        "",
    ),
    (
        "three_points",
        ARM.replace("child: b", "child: b, at: «[[0, 0], [0, 0], [0, 0]]"),
        "a list under 'at'",
        "two points",
        "",
    ),
    (
        "unknown_load",
        ARM + "loads: {s: {type: «sprig, joint: A, stiffness: 1}}\n",
        "unknown type 'sprig'",
        "spring, damper",
        "'spring'",
    ),
    (
        "no_load_type",
        ARM + "loads: {«s: {joint: A}}\n",
        "'s' does not say what it is",
        "type: spring",
        "",
    ),
    (
        "unknown_constraint",
        ARM + "constraints: {c: {type: «noslip, body: b}}\n",
        "unknown type 'noslip'",
        "no_slip",
        "'no_slip'",
    ),
    (
        "no_constraint_kind",
        ARM + "constraints: {«c: {body: b}}\n",
        "'c' does not say what it is",
        "holonomic:",
        "",
    ),
    ("constraint_is_text", ARM + "constraints: {c: «q - 1}\n", "text under 'c'", "a mapping", ""),
    # names
    (
        "model_name",
        "model: «four bar\ncoordinates: {x: m}\nkinetic: der(x)^2\n",
        "'four bar' is not a name",
        "letters, digits",
        "",
    ),
    (
        "model_is_module",
        "model: «math\n",
        "'math' is the name of a Python module",
        "another name",
        "",
    ),
    (
        "model_is_numpy",
        "model: «numpy\n",
        "'numpy' is the name of a Python module",
        "another name",
        "",
    ),
    (
        "python_keyword",
        "model: a\nparameters: {«lambda: 1}\n",
        "'lambda' is a keyword of Python",
        "another name",
        "",
    ),
    (
        "c_keyword",
        "model: a\nparameters: {«double: 1}\n",
        "'double' is a keyword of C",
        "another name",
        "",
    ),
    (
        "cpp_keyword",
        "model: a\nparameters: {«template: 1}\n",
        "'template' is a keyword of C++",
        "another name",
        "",
    ),
    (
        "c_macro",
        "model: a\nparameters: {«NAN: 1}\n",
        "'NAN' is defined by C headers",
        "another name",
        "",
    ),
    (
        "c_macro_of_the_module",
        "model: «x\nparameters: {a: 1}\n",
        "the module of 'x' would define X_OK, as C headers do",
        "a longer name",
        "",
    ),
    (
        "decimal_comma",
        "model: a\nparameters: {m: 2,«5 kg}\n",
        "'5 kg' is not a name",
        "a number has a decimal point: 2.5 kg",
        "",
    ),
    (
        "degree_sign",
        "model: a\nparameters: {a: 30«°}\n",
        "unexpected character '°'",
        "",
        "it is written deg",
    ),
    (
        "joint_of_another_tool",
        "model: a\nbodies: {b: {mass: 1}}\n"
        "joints: {J: {type: «hinge, axis: x, parent: ground, child: b}}\n",
        "unknown type of joint 'hinge'",
        "prismatic",
        "did you mean 'revolute'?",
    ),
    (
        "constant_of_the_header",
        "model: a\nparameters: {«A_NX: 1}\n"
        "bodies: {b: {mass: 1}}\n"
        "joints: {J: {type: prismatic, axis: x, parent: ground, child: b}}\n",
        "the parameter 'A_NX' is like the constants A_… of the generated header",
        "another name, such as a_nx",
        "",
    ),
    (
        "language_word",
        "model: a\nparameters: {«t: 1}\n",
        "'t' is a word of the model language",
        "another name",
        "",
    ),
    (
        "function_name",
        "model: a\nparameters: {«sin: 1}\n",
        "'sin' is a word of the model language",
        "another name",
        "",
    ),
    (
        "ground_body",
        BAR + "bodies: {«ground: {mass: m}}\n" + JOINT,
        "'ground' is a word of the model language",
        "another name",
        "",
    ),
    (
        "bad_character",
        "model: a\nparameters: {«m-1: 1}\n",
        "'m-1' is not a name",
        "digits and underscores",
        "",
    ),
    ("unicode_name", "model: a\nparameters: {«µ: 1}\n", "'µ' is not a name", "a letter", ""),
    (
        "leading_underscore",
        "model: a\nparameters: {«_m: 1}\n",
        "'_m' is not a name",
        "a letter",
        "",
    ),
    (
        "double_underscore",
        "model: a\nparameters: {«a__b: 1}\n",
        "'a__b' is not a name",
        "no double",
        "",
    ),
    (
        "long_name",
        "model: a\nparameters: {«" + "n" * 61 + ": 1}\n",
        "is not a name",
        "at most 60",
        "",
    ),
    (
        "same_name",
        ARM.replace("coordinate: q", "coordinate: «m"),
        "the coordinate 'm' is the name of a parameter, line 3, column 14",
        "",
        "",
    ),
    (
        "mapped_collision",
        BAR.replace("m: 1 kg", "base_vx: 1, m: 1 kg")
        + BODY
        + "joints: {«base: {type: planar, parent: ground, child: b}}\n",
        "the velocity 'base.vx' is like the parameter 'base_vx' in generated code, line 3, column 14",
        "another name",
        "",
    ),
    (
        "joint_and_closure",
        TREE + "closures: {«A: {type: revolute, between: [a, b], at: [[0, 0], [0, 0]]}}\n",
        "the closure 'A' is the name of a joint",
        "",
        "",
    ),
    (
        "same_row_names",
        ARM + "quasi_velocities: {c: {w: der(q), «w_: der(q)}}\n",
        "'w_' is not a name",
        "",
        "",
    ),
    (
        "row_has_a_name",
        ARM + "quasi_velocities: {c: {«m: der(q)}}\n",
        "the quasi-velocity 'm' has the name of a parameter",
        "another",
        "",
    ),
    # units and numbers
    ("wrong_unit", BAR + "bodies: {b: {mass: «2 m}}\n" + JOINT, "a mass in m", "kg", ""),
    ("wrong_unit_formula", BAR + "bodies: {b: {mass: «m*l}}\n" + JOINT, "a mass in kg*m", "kg", ""),
    ("add_units", BAR + "bodies: {b: {mass: m + «l}}\n" + JOINT, "cannot add m to kg", "kg", ""),
    (
        "sine_of_length",
        ARM + "outputs: {o: sin(«l)}\n",
        "sin() of a quantity in m",
        "a plain number or an angle",
        "",
    ),
    ("exponent_unit", ARM + "outputs: {o: 2^«l}\n", "an exponent in m", "a plain number", ""),
    (
        "variable_power",
        ARM + "outputs: {o: l^«q}\n",
        "m to a power that is not a number",
        "a base without unit",
        "",
    ),
    (
        "unknown_unit",
        "model: a\nparameters: {l: 0.2 «metre}\n",
        "unknown unit 'metre'",
        "m, kg, s",
        "",
    ),
    (
        "unit_case",
        "model: a\nparameters: {m: 2 «KG}\n",
        "unknown unit 'KG'",
        "m, kg, s",
        "did you mean 'kg'?",
    ),
    (
        "joined_unit",
        "model: a\nparameters: {k: 2 «Nm}\n",
        "unknown unit 'Nm'",
        "m, kg, s",
        "did you mean 'N*m'?",
    ),
    (
        "half_a_kilogram",
        "model: a\nparameters: {m: 1/«2 kg}\n",
        "can be read two ways",
        "0.5 kg",
        "",
    ),
    ("unit_or_name", ARM + "parameters2: 1\n", "unknown key 'parameters2'", "", "'parameters'"),
    (
        "ambiguous_unit",
        ARM + "outputs: {o: 2 N*«m}\n",
        "'m' can be the unit or the model's own name",
        "(2 N*m) for the unit, (2 N)*m for the name",
        "",
    ),
    (
        "coordinate_unit",
        "model: a\ncoordinates: {x: «mm}\nkinetic: der(x)^2\n",
        "'mm' is not an SI unit",
        "m",
        "use SI",
    ),
    (
        "unknown_coordinate_unit",
        "model: a\ncoordinates: {x: «meter}\nkinetic: 1 J\n",
        "unknown unit 'meter'",
        "m, kg, s",
        "",
    ),
    (
        "rows_of_unknown_names",
        ARM + "quasi_velocities: {c: [«base, der(q)]}\n",
        "unknown name 'base'",
        "q",
        "",
    ),
    (
        "octal_number",
        "model: a\nparameters: {m: «017 kg}\n",
        "the number '017' starts with a zero",
        "17: octal",
        "",
    ),
    (
        "date_as_number",
        "model: a\nparameters: {m: «2020-01-01}\n",
        "'2020-01-01' is a date",
        "2020 - 1 - 1",
        "",
    ),
    (
        "date_without_zeros",
        "model: a\nparameters: {m: «2026-11-28}\n",
        "'2026-11-28' is a date",
        "dates are not part of the model language",
        "",
    ),
    (
        "tag_of_a_number",
        'model: a\nparameters: {m: «!!int "3"}\n',
        "a tag '!!int'",
        "tags are not part of the model language",
        "",
    ),
    (
        "unit_of_two_masses",
        "model: a\nparameters: {m: 2 «kgg}\n",
        "unknown unit 'kgg'",
        "kg",
        "did you mean 'kg'?",
    ),
    (
        "unit_without_a_number",
        ARM + "quasi_velocities: {c: [der(q)*(1/«rad)]}\n",
        "unknown name 'rad'",
        "der(q)",
        "a unit stands behind a number: 1 rad, 1 1/rad, x/(1 rad)",
    ),
    (
        "unit_without_a_number_in_a_load",
        ARM + "loads: {f: {type: force, body: b, components: ['1 N', 'q*«N']}}\n",
        "unknown name 'N'",
        "q",
        "a unit stands behind a number: 1 N, 1 1/N, x/(1 N)",
    ),
    (
        "velocity_mistyped",
        ARM + "quasi_velocities: {c: [l*«dq2]}\n",
        "unknown name 'dq2'",
        "der(q), each with a factor if need be",
        "",
    ),
    (
        "key_of_a_formula_given_twice",
        "model: a\nparameters: {m: «max(1, 1, 1, 2)}\n",
        "'max(1' ends at a comma, within its brackets",
        "a formula in quotes",
        'a formula with a comma stands in quotes: "max(a, b)"',
    ),
    (
        "formula_cut_in_a_list",
        BAR + "loads: {f: {type: force, body: b, components: [1 N, «dot(position(b), "
        "direction(b, x))*(2 N/m)]}}\n",
        "'dot(position(b)' ends at a comma, within its brackets",
        "a formula in quotes",
        'a formula with a comma stands in quotes: "max(a, b)"',
    ),
    (
        "list_in_a_formula_in_a_list",
        BAR + "loads: {f: {type: force, body: b, components: [-position(b, [0, 1]«).x, 0]}}\n",
        "not valid YAML",
        "",
        'a formula that holds [ ] stands in quotes: "position(a, [0, 1 m]).x"',
    ),
    (
        "key_in_the_middle_of_a_formula",
        "model: a\nplane: xy\nbodies: {b: {mass: max(1, «2, 3)}}\n",
        "unknown key '2'",
        "mass",
        'a formula with a comma stands in quotes: "max(a, b)"',
    ),
    (
        "huge_number",
        "model: a\nparameters: {m: «1e400 kg}\n",
        "the number is too large",
        "below 1e+60 in SI units",
        "",
    ),
    (
        "tiny_number",
        "model: a\nparameters: {m: «1e-400 kg}\n",
        "too small to tell from zero",
        "above 1e-60 in SI units",
        "",
    ),
    (
        "input_as_unit",
        ARM + "inputs: {fx: «N}\n",
        "text under 'fx'",
        "a mapping with joint",
        "its unit alone is {unit: N}",
    ),
    (
        "force_of_a_force",
        ARM + "loads: {f: {type: force, body: b, «force: [1 N, 0]}}\n",
        "unknown key 'force'",
        "components",
        "did you mean 'components'?",
    ),
    (
        "load_among_forces",
        ARM + "forces:\n  f: «{type: spring, between: [ground, b], stiffness: 1 N/m}\n",
        "a mapping under 'f'",
        "a formula for each coordinate; springs, dampers, forces and torques with a type stand "
        "under `loads:`",
        "",
    ),
    (
        "springs_as_a_section",
        ARM + "«springs: {f: 1 N/m}\n",
        "unknown key 'springs'",
        "model, description",
        "did you mean 'loads'?",
    ),
    (
        "position_in_a_formula",
        ARM + "potential: «(1 N)*position(b)\n",
        "a vector where a number is needed",
        "a component, .x or .y",
        "",
    ),
    (
        "motion_in_a_mass",
        ARM + "constraints: {c: {type: distance, between: [ground, b], "
        "at: [[0, 0], [0, 0]], length: «position(b).x}}\n",
        "'position(b).x' is a coordinate and cannot stand in a length",
        "parameters",
        "",
    ),
    (
        "motion_of_nothing",
        ARM + "where: {w: position(«c).x}\n",
        "unknown body or frame 'c'",
        "b",
        "",
    ),
    (
        "motion_component",
        ARM + "where: {w: «position(b).z}\n",
        "unknown component '.z'",
        "x, y",
        "",
    ),
    ("motion_unit", ARM + "potential: «(1 N/s)*position(b).x\n", "a potential energy in ", "J", ""),
    (
        "motion_in_kinetic",
        ARM + "coordinates: {z: m}\nkinetic: «(1 kg)/2*velocity(b).x^2\n",
        "'velocity(b).x' in a kinetic energy",
        "rates",
        "give it a mass",
    ),
    (
        "rate_of_a_rate",
        ARM + "where: {w: der(«velocity(b).x)}\n",
        "der() of 'velocity(b).x', a velocity",
        "coordinates and t",
        "",
    ),
    (
        "rate_of_nothing",
        ARM + "where: {w: «der(2*l)}\n",
        "der() of what does not change",
        "coordinates or t",
        "",
    ),
    (
        "rate_not_smooth",
        ARM + 'where: {w: "der(«max(q, 0.1))"}\n',
        "der() of max(), which is not smooth",
        "smooth",
        "",
    ),
    (
        "motion_of_itself",
        ARM + 'where: {w: "«distance(b, b)"}\n',
        "a length that is always zero",
        "two points that differ",
        "",
    ),
    (
        "motion_products",
        ARM + "where: {w: norm(position(b)*«position(b))}\n",
        "a product of vectors",
        "dot",
        "",
    ),
    ("motion_matrix", ARM + "where: {w: «orientation(b)}\n", "a matrix where a number", ".xx", ""),
    (
        "motion_point",
        ARM + 'where: {w: "distance(b, «[0, 0, 0], ground)"}\n',
        "the second argument is not a point",
        "[x, y]",
        "",
    ),
    (
        "motion_point_unit",
        ARM + 'where: {w: "distance(b, [«m, 0], ground)"}\n',
        "a point in kg",
        "m",
        "",
    ),
    (
        "reaction_in_a_formula",
        ARM + "where: {f: «reaction(A)}\n",
        "reaction() stands alone in an entry of `outputs:`",
        "",
        "reaction.NAME",
    ),
    (
        "sine_of_a_time",
        ARM + "where: {f: sin(«3*t)}\n",
        "sin() of a quantity in s",
        "a plain number or an angle",
        "sin((3 rad/s)*t)",
    ),
    (
        "exponential_of_a_time",
        ARM + "where: {f: exp(«-0.5*t)}\n",
        "exp() of a quantity in s",
        "a plain number or an angle",
        "exp(-(0.5 rad/s)*t)",
    ),
    (
        "bare_torque",
        ARM + "loads: {f: {type: expression, joint: A, expression: «2*sin(q)}}\n",
        "a force in a plain number or an angle",
        "N*m",
        "(2 N*m)*sin(q)",
    ),
    (
        "torque_without_a_factor",
        ARM + "loads: {f: {type: expression, joint: A, expression: «sin(q)}}\n",
        "a force in a plain number or an angle",
        "N*m",
        "(1 N*m)*sin(q)",
    ),
    (
        "bare_summand",
        ARM + "loads: {f: {type: expression, joint: A, expression: (1 N*m) + «2*sin(q)}}\n",
        "cannot add a plain number",
        "N*m",
        "(1 N*m) + (2 N*m)*sin(q)",
    ),
    (
        "six_coordinates_of_a_free_joint",
        "model: a\nbodies: {b: {mass: 1 kg}}\njoints: {B: {type: free, parent: ground, child: b, coordinates: «[x, y, z, r, p, w]}}\n",
        "6 coordinates of the free joint 'B'",
        "7: [",
        "orientation: {euler: zyx}",
    ),
    ("tower", "model: a\nparameters: {m: «9**9**9}\n", "not a finite number", "", ""),
    ("division_by_zero", "model: a\nparameters: {m: 1/«0}\n", "division by zero", "", ""),
    ("root_of_negative", "model: a\nparameters: {m: «sqrt(-1)}\n", "not a finite number", "", ""),
    (
        "not_a_number",
        "model: a\nparameters: {m: «nan}\n",
        "'nan' in the value of a parameter",
        "a number with its unit",
        "`where:`",
    ),
    (
        "parameter_formula",
        "model: a\nparameters: {l: 1 m, h: «l/2}\n",
        "'l' in the value of a parameter",
        "a number",
        "`where:`",
    ),
    ("empty_parameter", "model: a\nparameters: {m: «}\n", "the formula is empty", "a number", ""),
    # formulas
    (
        "unknown_name",
        ARM.replace("com: [l/2", "com: [«L/2"),
        "unknown name 'L'",
        "m, l",
        "did you mean 'l'?",
    ),
    ("unknown_rate", ARM + "outputs: {o: der(«q9)}\n", "unknown coordinate 'q9'", "q", ""),
    (
        "rate_of_parameter",
        ARM + "outputs: {o: der(«m)}\n",
        "der() of 'm', which is not a coordinate",
        "q",
        "",
    ),
    (
        "undeclared_coordinate",
        POINT + "potential: m*(9.81 m/s^2)*«z\n",
        "unknown name 'z'",
        "x, y",
        "",
    ),
    (
        "unknown_velocity",
        SPACE + "outputs: {o: A.«vq}\n".replace("A.«", "«A."),
        "unknown name 'A.vq'",
        "",
        "",
    ),
    (
        "unknown_function",
        ARM + "outputs: {o: «sine(q)}\n",
        "unknown function 'sine'",
        "sin, cos",
        "did you mean 'sin'?",
    ),
    ("no_function", ARM + "outputs: {o: «l(2)}\n", "'l' is not a function", "an operator", ""),
    (
        "arity",
        ARM + "outputs: {o: «atan2(q)}\n",
        "atan2() does not take 1 argument",
        "2 arguments",
        "",
    ),
    (
        "bare_function",
        ARM + "outputs: {o: «sin}\n",
        "the function 'sin' has no argument",
        "sin(…)",
        "",
    ),
    ("unclosed", ARM + 'outputs: {o: "sin«(q"}\n', "'(' is never closed", "')'", ""),
    ("trailing", ARM + "outputs: {o: q «q}\n", "unexpected 'q'", "an operator", ""),
    ("half_formula", ARM + "outputs: {o: q +«}\n", "the formula ends too early", "a number", ""),
    (
        "python_code",
        ARM + "outputs: {o: «__import__('os')}\n",
        "unknown function '__import__'",
        "",
        "",
    ),
    (
        "bad_character_in_formula",
        ARM + "outputs: {o: q «@ q}\n",
        "unexpected character '@'",
        "an operator",
        "",
    ),
    ("juxtaposed", ARM + "outputs: {o: 2 «q}\n", "'q' stands directly after a number", "2*x", ""),
    (
        "rate_in_mass",
        ARM.replace("mass: m", "mass: m*«der(q)"),
        "'der(q)' is a velocity and cannot stand in a mass",
        "parameters",
        "",
    ),
    (
        "coordinate_in_point",
        ARM.replace("com: [l/2", "com: [l*«q"),
        "'q' is a coordinate and cannot stand in a centre of mass",
        "parameters",
        "",
    ),
    (
        "deep_formula",
        ARM + "outputs: {o: " + "(" * 60 + "«(q" + ")" * 61 + "}\n",
        "nested too deeply",
        "at most 60 levels",
        "`where:`",
    ),
    (
        "circular_where",
        ARM + "where: {«a: b + 1, b: a + 1}\n",
        "defined by itself",
        "without a circle",
        "",
    ),
    (
        "definition_out_of_place",
        POINT + "where: {speed: sqrt(der(x)^2)}\nconstraints: {c: {holonomic: x - «speed*(1 s)}}\n",
        "'speed' uses 'der(x)', a velocity, and cannot stand in a holonomic constraint",
        "parameters, coordinates and t",
        "`nonholonomic:`",
    ),
    # mechanism
    ("nothing_moves", "model: «a\n", "nothing that moves", "bodies with joints", ""),
    (
        "welded",
        BAR
        + BODY.replace("model", "model")
        + "joints: {A: {type: fixed, parent: ground, child: b}}\n".replace("A", "A"),
        "nothing that moves",
        "",
        "",
    ),
    (
        "unknown_parent",
        ARM.replace("parent: ground", "parent: «grund"),
        "unknown body 'grund'",
        "b, ground",
        "did you mean 'ground'?",
    ),
    ("unknown_child", ARM.replace("child: b", "child: «c"), "unknown body 'c'", "b", ""),
    (
        "ground_as_child",
        ARM.replace("child: b", "child: «ground"),
        "the ground as a child",
        "a body",
        "",
    ),
    (
        "joint_to_itself",
        ARM.replace("parent: ground", "parent: b").replace("child: b", "child: «b"),
        "joins 'b' to itself",
        "two bodies",
        "",
    ),
    (
        "two_parents",
        PAIR
        + f"joints:\n  {GROUND_A}\n  {GROUND_B}\n  C: {{type: revolute, parent: a, child: «b}}\n",
        "'b' is already the child of the joint 'B', line 7",
        "one joint per child",
        "`closures:`",
    ),
    (
        "body_without_joint",
        BAR + "bodies: {«a: {mass: m}, b: {mass: m}}\n" + JOINT,
        "no joint carries the body 'a'",
        "child: a",
        "planar joint",
    ),
    (
        "disconnected",
        BAR
        + "bodies: {c: {mass: m}, «a: {mass: m}, b: {mass: m}}\njoints: {A: {type: revolute, parent: b, child: a}, "
        "B: {type: revolute, parent: a, child: b}, C: {type: revolute, parent: ground, child: c}}\n",
        "the body 'a' is not connected to the ground",
        "a chain of joints",
        "",
    ),
    (
        "unknown_joint_type",
        ARM.replace("revolute", "«revolut"),
        "unknown type of joint 'revolut'",
        "revolute, prismatic",
        "'revolute'",
    ),
    (
        "free_in_plane",
        ARM.replace("revolute", "«free"),
        "a free joint in a planar model",
        "planar",
        "moves freely",
    ),
    (
        "two_coordinates",
        ARM.replace("coordinate: q", "coordinates: «[q, p]"),
        "2 coordinates of the revolute joint 'A'",
        "1: [rad]",
        "",
    ),
    (
        "one_of_three",
        ARM.replace("revolute", "planar").replace("coordinate: q", "coordinate: «q"),
        "1 coordinate of the planar joint",
        "3: [x, y, angle]",
        "",
    ),
    (
        "position_of_hinge",
        ARM.replace("coordinate: q", "position: «[x, y, z]"),
        "'position' of a revolute joint",
        "coordinate",
        "where the joint is stands under `at:`",
    ),
    (
        "euler_without_names",
        SPACE.replace("revolute", "free")
        .replace("coordinate: q, axis: z", "orientation: «euler")
        .replace(", axis: z", "")
        .replace("coordinate: q", "orientation: «euler"),
        "an orientation by Euler angles without names",
        "{euler: zxy, angles: [yaw, lean, spin]}",
        "",
    ),
    (
        "choice_without_a_name",
        ARM + "quasi_velocities: {w: «2*der(q)}\n",
        "a formula in the place of the choice 'w'",
        "orthonormal",
        "NAME: {w: 2*der(q)}",
    ),
    (
        "rate_by_the_name_of_code",
        ARM + "initial: {«q_dot: 1 rad/s}\n",
        "unknown coordinate or velocity 'q_dot'",
        "der(q)",
        "did you mean 'der(q)'?",
    ),
    (
        "equation",
        ARM + "constraints: {c: {holonomic: q «= 0}}\n",
        "unexpected character '='",
        "an operator",
        "a formula is made zero as it stands",
    ),
    (
        "no_blank_behind_a_colon",
        ARM.replace("{b: {mass: m,", "{b: {«mass:m,"),
        "unknown key 'mass:m'",
        "mass",
        "a blank stands behind the colon: mass: …",
    ),
    (
        "gravity_by_its_size_in_a_plane",
        "model: a\nplane: xz\ngravity: «9.81 m/s^2\n",
        "text under 'gravity'",
        "a list in [ ] of its components",
        "downwards: gravity: [0, -9.81 m/s^2]",
    ),
    (
        "gravity_by_its_size_in_space",
        "model: a\ngravity: «-9.81\n",
        "a number under 'gravity'",
        "a list in [ ] of its components",
        "downwards: gravity: [0, 0, -9.81]",
    ),
    (
        "names_without_brackets",
        ARM.replace("revolute", "planar").replace("coordinate: q", "coordinates: '«x, y, turn'"),
        "text under 'coordinates'",
        "a list in [ ]",
        "in brackets: coordinates: [x, y, turn]",
    ),
    (
        "components_by_name",
        ARM + "loads: {f: {type: force, body: b, components: «{x: 3, y: 2}}}\n",
        "a mapping under 'components'",
        "a list in [ ]",
        "in brackets: components: [3, 2]",
    ),
    (
        "comma_in_braces",
        ARM + "loads: {f: {type: force, body: b, components: «{x: max(0, q), y: 2}}}\n",
        "a mapping under 'components'",
        "a list in [ ]",
        'a formula with a comma stands in quotes: "max(a, b)"',
    ),
    (
        "damper_as_a_mapping",
        ARM.replace("coordinate: q", "coordinate: q, damper: «{coefficient: 3}"),
        "a mapping under 'damper'",
        "a text or a number",
        "its value alone: damper: 3",
    ),
    (
        "loads_without_names",
        ARM + "loads:\n  «- {type: spring, joint: A, stiffness: 3}\n",
        "a list under 'loads'",
        "a mapping",
        "each with a name of its own: loads: {a_name: …, another: …}",
    ),
    (
        "a_mass_as_a_body",
        PAIR.replace("a: {mass: m}", "a: «1 kg"),
        "text under 'a'",
        "a mapping with mass",
        "a: {mass: 1 kg} for a point mass",
    ),
    (
        "initial_in_a_joint",
        ARM.replace("coordinate: q", "coordinate: q, «initial: 3"),
        "unknown key 'initial'",
        "type, parent, child",
        "initial values stand under `initial:` of the model, by coordinate",
    ),
    (
        "radius_beside_a_shape",
        ARM + "constraints: {c: {type: rolling, body: b, «radius: 0.3}}\n",
        "unknown key 'radius'",
        "shape",
        "a radius is one of the shape: shape: {wheel: {radius: …}}",
    ),
    (
        "steady_motion_without_a_name",
        ARM + "steady_motion: {q: «0}\n",
        "a number under 'q'",
        "a mapping",
        "motions have names: steady_motion: {a_name: {q: 0, …}}",
    ),
    (
        "three_angles_of_a_ball",
        SPACE.replace("revolute", "ball").replace(
            ", axis: z, coordinate: q", ", coordinates: «[a, b, c]"
        ),
        "3 coordinates of the ball joint 'A'",
        "4: [qw, qx, qy, qz]",
        "angles take a sequence of axes: orientation: {euler: zyx}",
    ),
    (
        "inertia_of_two_rows",
        SPACE.replace("m*l^2/12", "«[[1, 0, 0], [0, 1, 0]]"),
        "this is not a matrix of moments of inertia",
        "three rows of three numbers",
        "",
    ),
    (
        "inertia_of_two_parameters",
        SPACE.replace("m*l^2/12", "[[3, m*l^2, 0], [«l*l*(1 kg), 3, 0], [0, 0, 3]]").replace(
            "mass: m", "mass: 9"
        ),
        "across the diagonal",
        "a tensor of inertia is symmetric",
        "",
    ),
    (
        "inertia_that_is_not_symmetric",
        SPACE.replace("m*l^2/12", "[[1, 0.1, 0], [«0.2, 1, 0], [0, 0, 1]]"),
        "'0.2' here and '0.1' across the diagonal",
        "a tensor of inertia is symmetric",
        "",
    ),
    (
        "euler",
        SPACE.replace("revolute", "free").replace(
            ", axis: z, coordinate: q", ", orientation: {euler: «zzx}"
        ),
        "'zzx' is not a sequence",
        "zxy",
        "",
    ),
    (
        "two_angles",
        SPACE.replace("revolute", "free").replace(
            ", axis: z, coordinate: q", ", orientation: {euler: zyx, angles: «[a, b]}"
        ),
        "2 names for the orientation",
        "three names",
        "",
    ),
    (
        "no_axis",
        SPACE.replace("joints: {A", "joints: {«A").replace(", axis: z", ""),
        "the revolute joint 'A' has no axis",
        "axis: x, y, z",
        "",
    ),
    (
        "prismatic_no_axis",
        ARM.replace("joints: {A", "joints: {«A").replace("revolute", "prismatic"),
        "the prismatic joint 'A' has no axis",
        "axis: x, y",
        "",
    ),
    (
        "zero_axis",
        SPACE.replace("axis: z", "axis: «[0, 0, 0]"),
        "an axis of length zero",
        "a direction",
        "",
    ),
    ("unknown_axis", SPACE.replace("axis: z", "axis: «w"), "an axis 'w'", "x, y, z", ""),
    (
        "axis_out_of_plane",
        ARM.replace("revolute", "prismatic").replace("child: b", "child: b, axis: «z"),
        "an axis 'z'",
        "x, y",
        "",
    ),
    (
        "axis_of_planar_hinge",
        ARM.replace("child: b", "child: b, axis: «x"),
        "an axis of a revolute joint in a planar model",
        "it is z",
        "",
    ),
    (
        "axis_of_parameters",
        SPACE.replace("axis: z", "axis: «[l, 0, 0]"),
        "an axis that depends on parameters",
        "numbers",
        "`rpy`",
    ),
    (
        "rpy_in_plane",
        ARM.replace("child: b", "child: b, rpy: «[0, 0, 0]"),
        "'rpy' in a planar model",
        "angle",
        "",
    ),
    (
        "angle_in_space",
        SPACE.replace("child: b", "child: b, angle: «30 deg"),
        "'angle' in space",
        "rpy",
        "",
    ),
    (
        "angle_in_metres",
        ARM.replace("child: b", "child: b, angle: «3 m"),
        "an angle in m",
        "rad",
        "",
    ),
    (
        "three_in_plane",
        ARM.replace("com: [l/2, 0]", "com: «[l/2, 0, 0]"),
        "a centre of mass with 3 components",
        "2 in a planar model",
        "",
    ),
    (
        "two_in_space",
        SPACE.replace("com: [l/2, 0, 0]", "com: «[l/2, 0]"),
        "a centre of mass with 2 components",
        "3 in space",
        "",
    ),
    (
        "gravity_size",
        ARM + "gravity: «[0, 0, -9.81 m/s^2]\n",
        "gravity with 3 components",
        "2 in a planar model",
        "",
    ),
    ("gravity_unit", ARM + "gravity: [0, «-9.81 m/s]\n", "gravity in m/s", "m/s^2", ""),
    (
        "negative_mass",
        BAR.replace("m: 1 kg", "m: -1 kg") + BODY.replace("mass: m", "mass: «m") + JOINT,
        "the mass of 'b' is -1 kg",
        "zero or more",
        "",
    ),
    (
        "negative_inertia",
        ARM.replace("inertia: m*l^2/12", "inertia: «-1 kg*m^2"),
        "a moment of inertia of 'b' is -1 kg*m^2",
        "zero or more",
        "",
    ),
    (
        "impossible_inertia",
        SPACE.replace("inertia: m*l^2/12", "inertia: «[1, 1, 3]"),
        "no body has the inertia of 'b': 1 + 1 < 3",
        "the sum of the other two",
        "",
    ),
    (
        "indefinite_inertia",
        SPACE.replace("inertia: m*l^2/12", "inertia: «[1, 1, 1, 2, 0, 0]"),
        "a principal moment of inertia of 'b' is -1",
        "zero or more",
        "",
    ),
    (
        "inertia_count",
        SPACE.replace("inertia: m*l^2/12", "inertia: «[1, 1]"),
        "2 moments of inertia",
        "three",
        "",
    ),
    (
        "inertia_in_plane",
        ARM.replace("inertia: m*l^2/12", "inertia: «[1, 1, 1]"),
        "3 moments of inertia",
        "one moment",
        "",
    ),
    (
        "closure_with_itself",
        ARM + "closures: {C: {type: revolute, between: «[b, b], at: [[0, 0], [0, 0]]}}\n",
        "between 'b' and itself",
        "two bodies",
        "",
    ),
    (
        "closure_body",
        ARM + "closures: {C: {type: revolute, between: [b, «c], at: [[0, 0], [0, 0]]}}\n",
        "unknown body 'c'",
        "b, ground",
        "",
    ),
    (
        "closure_type",
        ARM + "closures: {C: {type: «hinge, between: [b, ground], at: [[0, 0], [0, 0]]}}\n",
        "unknown type of closure 'hinge'",
        "revolute",
        "",
    ),
    (
        "closure_of_three",
        ARM + "closures: {C: {type: fixed, between: «[b, b, b], at: [[0, 0], [0, 0]]}}\n",
        "between 3 bodies",
        "two bodies",
        "",
    ),
    # constraints
    (
        "quadratic",
        POINT + "constraints: {c: {nonholonomic: «der(x)*der(y)}}\n",
        "of degree 2 in the rates",
        "linear in the rates",
        "",
    ),
    (
        "not_linear",
        POINT + "constraints: {c: {nonholonomic: «sqrt(der(x)^2 + der(y)^2) - 1 m/s}}\n",
        "not linear in the rates",
        "linear",
        "",
    ),
    (
        "no_rates",
        POINT + "constraints: {c: {nonholonomic: «x - y}}\n",
        "without rates",
        "linear in the rates",
        "`holonomic:`",
    ),
    (
        "rates_in_holonomic",
        POINT + "constraints: {c: {holonomic: «der(x)}}\n",
        "'der(x)' is a velocity and cannot stand in a holonomic constraint",
        "",
        "`nonholonomic:`",
    ),
    (
        "constant_holonomic",
        POINT + "constraints: {c: {holonomic: «l - 1 m}}\n",
        "without coordinates",
        "stays zero",
        "",
    ),
    (
        "input_in_constraint",
        POINT + "inputs: {u: {}}\nconstraints: {c: {nonholonomic: der(x) - «u}}\n",
        "'u' is an input and cannot stand in",
        "",
        "",
    ),
    (
        "nonideal_count",
        POINT + 'constraints: {c: {holonomic: x, nonideal: «["0"]}}\n',
        "1 nonideal forces of 'c'",
        "one for each of x, y",
        "",
    ),
    (
        "nonideal_name",
        POINT + "constraints: {c: {holonomic: x, nonideal: {«z: 1}}}\n",
        "unknown coordinate 'z'",
        "x, y",
        "",
    ),
    (
        "nonideal_unit",
        POINT + "constraints: {c: {holonomic: x, nonideal: {x: «m}}}\n",
        "a generalised force in kg",
        "N",
        "",
    ),
    (
        "no_slip_body",
        ARM + "constraints: {c: {type: no_slip, body: «c, direction: y}}\n",
        "unknown body 'c'",
        "b",
        "",
    ),
    (
        "no_slip_direction",
        ARM + "constraints: {c: {type: no_slip, body: b, direction: «z}}\n",
        "a direction 'z'",
        "x, y",
        "",
    ),
    (
        "rolling_radius",
        SPACE
        + "constraints: {c: {type: rolling, body: b, shape: {disk: {radius: «0 m, axis: y}}, plane: {normal: z}}}\n",
        "the radius of 'c' is 0 m",
        "more than zero",
        "",
    ),
    (
        "rolling_axis",
        SPACE
        + "constraints: {«c: {type: rolling, body: b, shape: {disk: {radius: l}}, plane: {normal: z}}}\n",
        "the disk of 'c' has no axis",
        "axis",
        "",
    ),
    # loads, inputs, outputs
    (
        "load_nowhere",
        ARM + "loads: {«s: {type: spring, stiffness: 1}}\n",
        "'s' does not say where it acts",
        "joint, coordinate",
        "",
    ),
    (
        "load_twice",
        ARM + "loads: {«s: {type: damper, joint: A, coordinate: q, coefficient: 1}}\n",
        "'s' acts in 2 places",
        "one of",
        "",
    ),
    (
        "load_joint",
        ARM + "loads: {s: {type: damper, joint: «B, coefficient: 1}}\n",
        "unknown moving joint 'B'",
        "A",
        "",
    ),
    (
        "stiffness_unit",
        ARM + "loads: {s: {type: spring, joint: A, stiffness: «3 N/m}}\n",
        "a stiffness in N/m",
        "N*m/rad",
        "",
    ),
    (
        "damping_unit",
        ARM + "loads: {s: {type: damper, joint: A, coefficient: «3 kg}}\n",
        "a damping coefficient in kg",
        "N*m*s/rad",
        "",
    ),
    (
        "points_missing",
        TREE + "loads: {«s: {type: spring, between: [a, b], stiffness: 1}}\n",
        "does not say which points",
        "at: [[…], […]]",
        "",
    ),
    (
        "mixed_spring",
        ARM + "loads: {s: {type: spring, joint: A, stiffness: 1, length: «1 m}}\n",
        "'length' of 's' belongs to a load between two points",
        "between",
        "did you mean 'rest'?",
    ),
    (
        "mixed_points",
        TREE
        + "loads: {s: {type: spring, between: [a, b], at: [[0, 0], [0, 0]], stiffness: 1, rest: «1 m}}\n",
        "'rest' of 's' belongs to a load at a joint",
        "between",
        "did you mean 'length'?",
    ),
    (
        "ends_of_a_spring",
        TREE + "loads: {s: {type: spring, «from: [a, b], at: [[0, 0], [0, 0]], stiffness: 1}}\n",
        "unknown key 'from'",
        "between",
        "did you mean 'between'?",
    ),
    (
        "ends_of_a_joint",
        BAR + BODY + "joints: {J: {type: revolute, «from: ground, child: b}}\n",
        "unknown key 'from'",
        "parent",
        "did you mean 'parent'?",
    ),
    (
        "separator",
        BAR + BODY + "joints: {J: {type: planar, parent: ground, child: b}}\ninitial: {«J.x: 1}\n",
        "unknown coordinate or velocity 'J.x'",
        "J_x",
        "did you mean 'J_x'?",
    ),
    (
        "force_frame",
        ARM + "loads: {f: {type: force, body: b, components: [0, 0], frame: «world}}\n",
        "unknown axes 'world'",
        "ground, body",
        "",
    ),
    (
        "force_unit",
        ARM + "loads: {f: {type: force, body: b, components: [0, «m*l]}}\n",
        "a force in kg*m",
        "N",
        "",
    ),
    (
        "torque_size",
        ARM + "loads: {f: {type: torque, body: b, components: «[0, 0]}}\n",
        "a torque with 2 components",
        "1",
        "",
    ),
    ("force_coordinate", POINT + "forces: {«z: 1 N}\n", "unknown coordinate 'z'", "x, y", ""),
    (
        "input_joint",
        ARM + "inputs: {u: {joint: «a}}\n",
        "unknown moving joint 'a'",
        "A",
        "did you mean 'A'?",
    ),
    (
        "input_of_planar",
        ARM.replace("revolute", "planar").replace(", coordinate: q", "")
        + "inputs: {u: {joint: «A}}\n",
        "the joint 'A' has 3 velocities",
        "A.vx, A.vy, A.w",
        "",
    ),
    (
        "input_of_x",
        ARM.replace("revolute", "planar").replace("coordinate: q", "coordinates: [x, y, th]")
        + "inputs: {u: {coordinate: «x}}\n",
        "der(x) is not a generalized velocity of its joint",
        "A.vx",
        "",
    ),
    (
        "force_on_a_quaternion",
        "model: top\nbodies: {b: {mass: 1 kg, inertia: 1}}\n"
        "joints: {A: {type: ball, parent: ground, child: b}}\nforces: {«A_qw: 1 N*m}\n",
        "der(A_qw) is not a generalized velocity of its joint",
        "a joint with one velocity",
        "",
    ),
    (
        "input_unit",
        ARM + "inputs: {u: {joint: A, unit: «N}}\n",
        "an input in N at a place that takes N*m",
        "N*m",
        "",
    ),
    ("output_body", ARM + 'outputs: {o: "position(«c, [0, 0])"}\n', "unknown body 'c'", "b", ""),
    (
        "output_point",
        ARM + 'outputs: {o: "position(b, «[0, 0, 0])"}\n',
        "the second argument is not a point",
        "[x, y]",
        "",
    ),
    ("output_point_unit", ARM + 'outputs: {o: "position(b, [«m, 0])"}\n', "a point in kg", "m", ""),
    (
        "output_mixed",
        ARM + 'outputs: {o: "1 + «reaction(A)"}\n',
        "reaction() inside a formula",
        "alone",
        "",
    ),
    (
        "output_reaction",
        ARM + "outputs: {o: reaction(«A)}\n",
        "unknown closure or constraint 'A'",
        "",
        "",
    ),
    ("output_angle", SPACE + "outputs: {o: «angle(b)}\n", "angle() of a body in space", "", ""),
    ("list_in_formula", ARM + 'where: {w: "«[1, 2]"}\n', "a list inside a formula", "", ""),
    # choices, initial state, steady motion, energies
    (
        "choice_kind",
        ARM + "quasi_velocities: {c: «orthnormal}\n",
        "unknown kind of choice 'orthnormal'",
        "auto, orthonormal, frozen, mass_orthogonal",
        "'orthonormal'",
    ),
    ("no_rows", ARM + "quasi_velocities: {«c: []}\n", "the choice 'c' has no rows", "formulas", ""),
    (
        "row_without_velocity",
        ARM + "quasi_velocities: {c: [«q]}\n",
        "a quasi-velocity without velocities",
        "linear",
        "",
    ),
    (
        "nonlinear_row",
        ARM + "quasi_velocities: {c: [«der(q)^2]}\n",
        "not linear in the velocities",
        "linear",
        "",
    ),
    (
        "affine_row",
        ARM + "quasi_velocities: {c: [«der(q) + 1]}\n",
        "a part that holds no velocity",
        "linear",
        "",
    ),
    (
        "same_rows",
        ARM + "quasi_velocities: {c: [der(q), «der(q)]}\n",
        "is the same as the row 'q_dot'",
        "independent rows",
        "",
    ),
    (
        "initial_name",
        ARM + "initial: {«qq: 1}\n",
        "unknown coordinate or velocity 'qq'",
        "q, der(q)",
        "did you mean 'q'?",
    ),
    ("initial_rate", ARM + "initial: {der(«p): 1}\n", "unknown coordinate 'p'", "q", ""),
    (
        "initial_parameter",
        ARM + "initial: {«m: 1}\n",
        "'m' is not a coordinate or velocity",
        "q",
        "",
    ),
    ("initial_unit", ARM + "initial: {q: «1 m}\n", "the initial q in m", "rad", ""),
    (
        "held_and_guessed",
        ARM + "initial: {q: 1, guess: {«q: 2}}\n",
        "'q' is given twice: held and guessed; first on line 6, column 11",
        "one of the two",
        "",
    ),
    (
        "initial_twice",
        ARM + "initial: {der(q): 1, «A.w: 2}\n",
        "'A.w' is given twice",
        "one of the two",
        "",
    ),
    ("guess_is_number", ARM + "initial: {guess: «1}\n", "text under 'guess'", "a mapping", ""),
    (
        "initial_mapping",
        ARM + "initial: {«hold: {q: 1}}\n",
        "a mapping under 'hold'",
        "`guess`",
        "",
    ),
    (
        "initial_definition",
        ARM + "where: {h: 2*l/l}\ninitial: {q: «h}\n",
        "the definition 'h' in the initial q",
        "numbers and parameters",
        "",
    ),
    (
        "steady_name",
        ARM + "steady_motion: {s: {«p: 0}}\n",
        "unknown coordinate or velocity 'p'",
        "q",
        "",
    ),
    (
        "kinetic_unit",
        POINT.replace("kinetic: ", "kinetic: «").replace("m/2*", "2*"),
        "a kinetic energy in m^2/s^2",
        "J",
        "",
    ),
    (
        "potential_rate",
        POINT + "potential: l*«der(x)\n",
        "'der(x)' is a velocity and cannot stand in a potential energy",
        "",
        "",
    ),
    (
        "no_kinetic",
        "model: a\ncoordinates: {«x: m}\n",
        "coordinates without a kinetic energy",
        "kinetic",
        "",
    ),
]


@pytest.mark.parametrize(
    ("marked", "message", "expected", "hint"),
    [case[1:] for case in ERRORS],
    ids=[case[0] for case in ERRORS],
)
def test_error(marked: str, message: str, expected: str, hint: str) -> None:
    found = first_problem(marked.replace("«", ""))
    assert message in found.message
    assert expected in found.expected
    assert hint in found.hint
    if "«" in marked:
        assert (found.line, found.column) == place(marked)
    assert str(found).startswith(f"model.yaml:{found.line}:{found.column}: error: ")


def first_problem(text: str):
    with pytest.raises(ModelError) as caught:
        load_text(text, "model.yaml")
    assert caught.value.exit_code == 1
    return caught.value.diagnostics[0]


def place(marked: str) -> tuple[int, int]:
    before = marked[: marked.index("«")].split("\n")
    return len(before), len(before[-1]) + 1


def test_rendering_shows_the_line_a_caret_and_the_nearest_name() -> None:
    with pytest.raises(ModelError) as caught:
        load_text("model: a\nbodies:\n  b: {mas: 1}\n", "a.yaml")
    assert str(caught.value) == (
        "a.yaml:3:7: error: unknown key 'mas'\n    b: {mas: 1}\n        ^^^\n"
        "  expected: mass, com, first_moment, inertia, exhaust, physical, about, symbol\n  did you mean 'mass'?"
    )


def test_all_problems_are_reported_at_once_in_the_order_of_the_file() -> None:
    with pytest.raises(ModelError) as caught:
        load_text(
            ARM.replace("l/2", "L/2").replace("mass: m", "mass: M")
            + "outputs: {a: zz, b: sin(l)}\n"
        )
    assert [problem.line for problem in caught.value.diagnostics] == [4, 4, 6, 6]


def test_many_problems_are_cut_short() -> None:
    text = POINT + "outputs:\n" + "".join(f"  o{i}: nothing{i}\n" for i in range(50))
    with pytest.raises(ModelError) as caught:
        load_text(text)
    assert len(caught.value.diagnostics) == 50
    assert str(caught.value).endswith("… and 30 more")


def test_places_in_quoted_and_folded_text() -> None:
    assert first_problem(ARM + 'outputs: {o: "q + zz"}\n').column == len('outputs: {o: "q + ') + 1
    folded = first_problem(ARM + "outputs:\n  o: >\n    q +\n    zz\n")
    assert (folded.line, folded.message) == (7, "unknown name 'zz'")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"model: \xff\xfe", "the file is not UTF-8 text"),
        (b"model: a\n" + b"# x\n" * (1 << 20), "bytes"),
        (b"\x00", "control character"),
    ],
)
def test_bad_bytes(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_bytes(content)
    with pytest.raises(ModelError, match=message):
        load(file)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path, reason in (
        (tmp_path / "none.yaml", "No such file"),
        (tmp_path, "directory"),
        ("a\0b", "null"),
    ):
        with pytest.raises(ModelError, match=reason):
            load(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_not_waited_for_unless_it_was_handed_over(tmp_path: Path) -> None:
    for name in ("pipe.yaml", "pipe.urdf"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(
            ModelError, match=f"{name}: error: cannot be read: it is no regular file"
        ):
            load_any(tmp_path / name)
    reading, writing = os.pipe()
    os.write(writing, ARM.encode())
    os.close(writing)
    assert load(f"/dev/fd/{reading}").name == load_text(ARM).name
    os.close(reading)


def test_long_description_is_refused() -> None:
    with pytest.raises(ModelError, match="more than 64 KiB"):
        load_text(ARM + f"description: {'x' * (65 << 10)}\n")


def test_descriptions_keep_what_emitters_must_escape() -> None:
    nasty = "*/ \\\" ''' <script>alert(1)</script> \\N{BULLET} %s {{ x }} ?\\?/"
    model = load_text(ARM + f"description: {json.dumps(nasty)}\n")
    assert model.description == nasty


SECTIONS = [
    "parameters",
    "coordinates",
    "where",
    "bodies",
    "joints",
    "closures",
    "constraints",
    "kinetic",
    "forces",
    "loads",
]
SECTIONS += [
    "inputs",
    "outputs",
    "quasi_velocities",
    "initial",
    "steady_motion",
    "gravity",
    "description",
]


def readable(text: str) -> None:
    """Any text gives a Model or a ModelError, never another exception."""
    try:
        assert isinstance(load_text(text), Model)
    except ModelError as error:
        assert error.diagnostics and all(problem.message for problem in error.diagnostics)
        assert str(error)


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=200))
def test_any_text(text: str) -> None:
    readable(text)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(MODELS), st.data())
def test_mutated_models(path: Path, data: st.DataObject) -> None:
    text = path.read_text()
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 30)))
    pieces = st.sampled_from(
        [
            "",
            ":",
            "[",
            "{",
            "}",
            "der(",
            "^",
            " m",
            "1e999",
            "auto",
            "-",
            "\n",
            "\t",
            "der(q1)",
            "0",
            "ground",
            "&a",
            "*a",
        ]
    )
    readable(text[:start] + data.draw(pieces | st.text(max_size=5)) + text[end:])


@settings(max_examples=200, deadline=None)
@given(
    st.recursive(
        st.none() | st.text(max_size=6),
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
        ),
    ),
    st.data(),
)
def test_any_structure(node: object, data: st.DataObject) -> None:
    section = data.draw(st.sampled_from(SECTIONS))
    readable(json.dumps({"model": "a", section: node, "coordinates": {"x": "m"}}))


def test_exit_codes() -> None:
    codes = [
        kind("x").exit_code
        for kind in (HamelError, ModelError, AssumptionError, ToolchainError, VerificationError)
    ]
    assert codes == [1, 1, 2, 3, 4]


def test_a_problem_without_a_place() -> None:
    assert (
        str(ToolchainError("no C compiler found", hint="install gcc"))
        == "error: no C compiler found\n  install gcc"
    )


def test_the_caret_follows_tabs_and_long_lines_are_cut() -> None:
    tabbed = Diagnostic("f", 1, 4, 2, "no", source_line="a\tb cd")
    assert str(tabbed).splitlines()[2] == "   \t ^^"
    long = str(
        Diagnostic("f", 1, 5001, 3, "no", source_line="x" * 5000 + "bad" + "y" * 5000)
    ).splitlines()
    assert len(long[1]) < 200
    assert long[1][long[2].index("^") :].startswith("bad")


@pytest.mark.parametrize(
    ("name", "known", "expected"),
    [
        ("Q1", ["q2", "q1"], "q1"),
        ("masss", ["mass", "com"], "mass"),
        ("zzz", ["mass"], None),
        ("mass", [], None),
        ("", ["a"], None),
    ],
)
def test_nearest(name: str, known: list[str], expected: str | None) -> None:
    assert nearest(name, known) == expected


def test_the_rate_of_definitions_that_grow_is_refused_in_time() -> None:
    """Each takes the one before three times, so that the rate of the last has 3²⁴ terms."""
    chain = [f'  a{k}: "a{k - 1}*a{k - 1} + a{k - 1}/3"\n' for k in range(1, 25)]
    text = ARM + "where:\n  a0: q\n" + "".join(chain) + "outputs: {o: der(a24)}\n"
    found = first_problem(text)
    assert re.match(r"der\(\) of 'a\d+', which is written out in 100000 terms", found.message)
    assert load_text(text.replace("der(a24)", "der(a7)")).outputs


FORM = """model: m
plane: xy
bodies: {arm: {mass: 1, inertia: 1}, link: {mass: 1, inertia: 1}}
joints:
  A: {type: revolute, parent: ground, child: arm, coordinate: q1}
  B: {type: revolute, parent: arm, child: link, coordinate: q2}
"""


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("loads: {f: {type: torque, joint: A, components: 3 N*m}}", "{type: expression, joint: …"),
        ("loads: {f: {type: force, coordinate: q1, components: 3}}", "under `inputs:`"),
        ("loads: {f: 3 N*m}", "f: {type: expression, joint: …, expression: 3 N*m}"),
        ("constraints: {e: q1 - q2}", "e: {holonomic: q1 - q2}"),
        ("constraints: {e: der(q1) - der(q2)}", "e: {nonholonomic: der(q1) - der(q2)}"),
        ("constraints: {e: {type: gear, joints: [A, B], ratio: 1:2}}", "a quotient: 1/2"),
        ("quasi_velocities: {x: [link.w, der(q1)]}", "of a body it is angular_velocity(link)"),
        (
            "quasi_velocities: {x: [link.wz, der(q1)]}",
            '"dot(angular_velocity(link), direction(link, z))"',
        ),
        ("quasi_velocities: {x: [link.vx, der(q1)]}", '"dot(velocity(link), direction(link, x))"'),
    ],
)
def test_what_others_write_in_another_place(text: str, hint: str) -> None:
    found = first_problem(FORM + text)
    assert hint in found.hint


@pytest.mark.parametrize(
    ("text", "kind", "ending"),
    [
        ('<robot name="x">\n</robot>', "URDF", ".urdf"),
        ('<?xml version="1.0"?>\n<!-- a: b -->\n<mujoco model="x"/>', "MJCF", ".xml"),
    ],
)
def test_a_robot_file_with_another_ending(text: str, kind: str, ending: str) -> None:
    found = first_problem(text)
    assert found.message == f"this is {kind}, which describes a robot"
    assert f"the ending {ending}" in found.expected


def test_a_text_of_comments_is_read_in_time() -> None:
    started = time.process_time()
    assert "URDF" not in first_problem("<!-- -->" * 5000).message
    assert time.process_time() - started < 2.0
