"""Document → Model: names first, then the formulas that use them, then the whole."""

from __future__ import annotations

from dataclasses import replace

from derive.expressions.tree import ZERO, Expression, Name, Number, walk
from derive.model import actuators, definitions, letters, tables
from derive.model.collisions import check_collisions
from derive.model.document import MOST_BODIES, Key, Scalar, Source
from derive.model.language.keys import Entry
from derive.model.language.shape import Document, kind_of
from derive.model.loads.expression import generalised_force
from derive.model.loads.in_joint import in_joint
from derive.model.mechanism import bodies, frames, named_frames, paths, ties
from derive.model.mechanism import tree as mechanism
from derive.model.mechanism.frames import Frame, Names
from derive.model.mechanism.massless import check_tips
from derive.model.mechanism.space import Space
from derive.model.motion import delays, events, extremes, motions, published, states, steady
from derive.model.motion.delays import with_delays
from derive.model.motion.initial import initial
from derive.model.motion.speeds import records
from derive.model.motion.speeds import speeds as of_choices
from derive.model.names import module_objection
from derive.model.reader import Reader
from derive.model.records import GROUND, Constraint, Load, Model, Vector3
from derive.model.scope import COORDINATE, MOTION, PARAMETER, TIME, VELOCITY

LONGEST_TEXT = 64 << 10


def built(document: Document, source: Source) -> Model:
    """The Model of a document. Raises ModelError with every problem in it; but names first, as
    formulas that use names which are not known would all be reported in their wake."""
    reader = Reader(source, Space(document.plane or ""))
    _check_head(reader, document)
    curves = tables.tables(reader, document)
    reader.curves = {table.name: table for table in curves}
    joints, names = _names(reader, document)
    reader.finish()
    model = _model(reader, document, joints, names)
    model = replace(
        model,
        measures=reader.measures.of(accelerations=False),
        accelerations=reader.measures.of(accelerations=True),
        tables=curves,
        paths=tuple(reader.paths.values()),
    )
    reader.finish()
    check_tips(reader, model)
    actuators.check_held(reader, model)
    reader.finish()
    model = replace(model, notes=(*model.notes, *definitions.unused(reader, model.parameters)))
    return actuators.with_courses(with_delays(model, names.delays))


def _check_head(reader: Reader, document: Document) -> None:
    if problem := module_objection(document.model.text):
        reader.report(document.model.span, *problem)
    if len(document.bodies) > MOST_BODIES:
        name = next(key for i, key in enumerate(document.bodies) if i == MOST_BODIES)
        reader.report(
            name.span, f"the model has {len(document.bodies)} bodies", f"at most {MOST_BODIES}"
        )
        reader.finish()
    if document.description is not None and len(document.description.text) > LONGEST_TEXT:
        reader.report(
            document.description.span, "a description of more than 64 KiB", "one or two sentences"
        )
    if document.coordinates and document.kinetic is None:
        reader.report(
            next(iter(document.coordinates)).span,
            "coordinates without a kinetic energy",
            "kinetic: a formula of their rates",
        )


def _names(reader: Reader, document: Document) -> tuple[list[Frame], Names]:
    parameters = definitions.parameters(reader, document)
    reader.measures.paths = paths.names(document)
    reader.measures.frames = (
        GROUND,
        *dict.fromkeys(map(str, (*document.bodies, *document.frames, *document.joints))),
    )
    names = [
        frame
        for key, entry in document.joints.items()
        if (frame := frames.frame(reader, key, entry))
    ]
    coordinates, velocities = frames.analytic_coordinates(reader, document)
    if len(names) == len(document.joints):
        names = mechanism.ordered(reader, document, names)
    coordinates = tuple(c for frame in names for c in frame.coordinates) + coordinates
    velocities = tuple(v for frame in names for v in frame.velocities) + velocities
    if not coordinates and not reader.problems:
        reader.report(
            document.model.span,
            "the model has nothing that moves",
            "bodies with joints, or coordinates with kinetic",
        )
    frames.enter(reader, coordinates, velocities)
    inputs = actuators.inputs(reader, document, velocities)
    units = states.enter(reader, document)
    named_frames.check_names(reader, document)
    late = delays.delays(reader, document, inputs)
    own = Names(
        parameters,
        coordinates,
        velocities,
        inputs,
        (),
        units,
        late,
        frames.rates(names, velocities),
    )
    check_collisions(reader, document, own)
    reader.finish()
    return names, replace(own, definitions=definitions.definitions(reader, document))


def _model(reader: Reader, document: Document, joints: list[Frame], names: Names) -> Model:
    ties.enter_reactions(reader, document)
    for key, entries in document.paths.items():
        reader.paths[str(key)] = paths.path(reader, document, key, entries)
    outputs = tuple(
        motions.output(reader, document, names, key, scalar)
        for key, scalar in document.outputs.items()
    )
    choices = motions.choices(reader, document)
    speeds = of_choices(choices)
    found = tuple(bodies.body(reader, key, entry) for key, entry in document.bodies.items())
    model = Model(
        name=document.model.text,
        description=document.description.text if document.description else "",
        file=reader.source.file,
        text=reader.source.text,
        plane=reader.space.plane,
        gravity=_gravity(reader, document),
        parameters=names.parameters,
        coordinates=names.coordinates,
        velocities=names.velocities,
        definitions=names.definitions,
        bodies=found,
        joints=tuple(mechanism.joint(reader, frame) for frame in joints),
        closures=tuple(
            mechanism.closure(reader, document, key, entry)
            for key, entry in document.closures.items()
        ),
        constraints=tuple(
            _constraint(reader, document, names, key, entry)
            for key, entry in document.constraints.items()
        ),
        loads=(
            *_loads(reader, document, joints, names),
            *bodies.exhausts(reader, document.bodies, found),
        ),
        inputs=names.inputs,
        states=states.states(reader, document, names.states),
        outputs=outputs,
        events=events.events(reader, document, outputs),
        frames=tuple(
            named_frames.named_frame(reader, document, key, entry)
            for key, entry in document.frames.items()
        ),
        symbols=letters.letters(reader, document, names.coordinates),
        body_symbols=letters.of_bodies(reader, document),
        choices=choices,
        initial=initial(reader, document, joints, speeds),
        speeds=records(reader, speeds),
        steady_motions=tuple(
            steady.steady_motion(reader, key, entry, speeds)
            for key, entry in document.steady_motion.items()
        ),
        kinetic=_energy(reader, document.kinetic, "a kinetic energy", MOTION),
        published=tuple(
            published.published(reader, tuple(document.outputs), *item)
            for item in document.reference.items()
        ),
        extremes=tuple(
            extremes.extremes(reader, key, entry) for key, entry in document.extremes.items()
        ),
        redundant=document.redundant,
        sources=tuple((other.file, other.text) for other in reader.source.others),
        potential=_energy(
            reader,
            document.potential,
            "a potential energy",
            frozenset({PARAMETER, COORDINATE, TIME}),
        ),
    )
    return replace(model, notes=tuple(reader.notes))


def _gravity(reader: Reader, document: Document) -> Vector3 | None:
    """None where it is absent or zero, so that nothing downstream carries zeros about."""
    vector = reader.point(document.gravity, "gravity", "m/s^2")
    nothing = all(isinstance(component, Number) and component.value == 0.0 for component in vector)
    return None if nothing else vector


def _constraint(
    reader: Reader, document: Document, names: Names, key: Key, entry: Entry
) -> Constraint:
    reader.name(key)
    return kind_of("constraints", entry).read(reader, document, names, key, entry)


def _load(reader: Reader, document: Document, names: Names, key: Key, entry: Entry) -> Load | None:
    """None after reporting that the entry says too little."""
    reader.name(key)
    return kind_of("loads", entry).read(reader, document, names, key, entry)


def _loads(
    reader: Reader, document: Document, joints: list[Frame], names: Names
) -> tuple[Load, ...]:
    """Those of the joints first, then `loads:`, `forces:` and what the actuators bring along."""
    loads: list[Load | None] = [load for frame in joints for load in in_joint(reader, names, frame)]
    loads += [_load(reader, document, names, key, entry) for key, entry in document.loads.items()]
    loads += [
        generalised_force(reader, names, key, scalar) for key, scalar in document.forces.items()
    ]
    loads += actuators.rotors(reader, document, names)
    return tuple(entry for entry in loads if entry is not None)


def uses_measure(formula: Expression, reader: Reader) -> str:
    """A measure of the motion that a formula uses, through definitions too; "" where there is
    none."""
    seen: set[str] = set()
    left = [formula]
    while left:
        names = {node.name: None for node in walk(left.pop()) if isinstance(node, Name)}
        for name in (name for name in names if name not in seen):
            if name in reader.measures.found:
                return name
            seen.add(name)
            left += [reader.definitions[name]] if name in reader.definitions else []
    return ""


def _energy(
    reader: Reader, scalar: Scalar | None, where: str, allowed: frozenset[str]
) -> Expression | None:
    if scalar is None:
        return None
    formula = reader.formula(scalar, where, allowed, unit="J")
    if VELOCITY in allowed and (name := uses_measure(formula, reader)):
        reader.report(
            scalar.span,
            f"'{name}' in {where}",
            "coordinates, their rates and t",
            "what moves with a body is a body's inertia: give it a mass or an inertia",
        )
    return None if formula == ZERO else formula
