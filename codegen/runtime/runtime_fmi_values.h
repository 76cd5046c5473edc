/* Values of an FMU: what a value reference stands for, reading and setting. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* A status of a function as one of FMI: a solver may try a shorter step. */
static fmi3Status judged(const Instance *i, int status, const char *what)
{
    return status ? say(i, fmi3Discard, "%s at t = %.17g: %s", what, i->head->t, model.cause(status)) : fmi3OK;
}

/* The nearest consistent state to `given`. */
static int projected(Instance *i, const double *given, double *x)
{
    copy(x, given, model.states);
    if (!model.project)
        return 0;
    return model.project(i->head->t, given, i->u, i->p, x);
}

/* In Initialization Mode x follows from the start values. */
static fmi3Status settled(Instance *i)
{
    Head *const h = i->head;
    int status;
    if (h->mode != INITIALIZATION || h->settled)
        return fmi3OK;
    status = projected(i, i->given, i->reserve);
    if (status)
        return judged(i, status, "no consistent state near the start values");
    copy(i->x, i->reserve, model.states);
    h->settled = 1;
    return fmi3OK;
}

static fmi3Status rates(Instance *i)
{
    fmi3Status status = settled(i);
    if (status != fmi3OK || i->known[model.groups])
        return status;
    status = judged(i, model.dynamics(i->head->t, i->x, i->u, i->p, i->rates), "state derivative");
    i->known[model.groups] = status == fmi3OK;
    return status;
}

/* The values of group g. */
static fmi3Status group(Instance *i, size_t g, double **values)
{
    fmi3Status status = settled(i);
    size_t k;
    *values = i->values;
    for (k = 0; k < g; k++)
        *values += model.group[k].count;
    if (status != fmi3OK || i->known[g])
        return status;
    status = judged(i, model.group[g].values(i->head->t, i->x, i->u, i->p, *values), "variables");
    i->known[g] = status == fmi3OK;
    return status;
}

enum { TIME, STATE, RATE, INPUT, PARAMETER, VARIABLE, CONSTANT, NOTHING };

/* What a value reference stands for: its kind, and the place in that. */
static int kind_of(fmi3ValueReference reference, size_t *place)
{
    const size_t sizes[] = {1, model.states, model.states, model.inputs, model.parameters, variables(), model.constants};
    int kind = TIME;
    *place = reference;
    while (kind < NOTHING && *place >= sizes[kind])
        *place -= sizes[kind++];
    return kind;
}

static fmi3Status variable(Instance *i, size_t place, double *value)
{
    double *values;
    fmi3Status status;
    size_t g = 0;
    while (place >= model.group[g].count)
        place -= model.group[g++].count;
    if ((status = group(i, g, &values)) == fmi3OK)
        *value = values[place];
    return status;
}

static fmi3Status value_of(Instance *i, fmi3ValueReference reference, double *value)
{
    size_t k;
    const int kind = kind_of(reference, &k);
    fmi3Status status = kind == STATE ? settled(i) : kind == RATE ? rates(i) : fmi3OK;
    if (status != fmi3OK)
        return status;
    switch (kind) {
    case TIME: *value = i->head->t; return fmi3OK;
    case STATE: *value = i->x[k]; return fmi3OK;
    case RATE: *value = i->rates[k]; return fmi3OK;
    case INPUT: *value = i->u[k]; return fmi3OK;
    case PARAMETER: *value = i->p[k]; return fmi3OK;
    case CONSTANT: *value = model.constant[k]; return fmi3OK;
    case VARIABLE: return variable(i, k, value);
    default: return say(i, fmi3Error, "there is no variable with value reference %u", (unsigned)reference);
    }
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Float64 values[], size_t count)
{
    fmi3Status status = fmi3OK;
    size_t k;
    CHECK(BOTH, READABLE);
    if (n != count || (n && (!references || !values)))
        return refused(i, __func__, "as many values as value references are needed");
    for (k = 0; k < n && status == fmi3OK; k++)
        status = value_of(i, references[k], values + k);
    return status;
}

/* In which modes a variable may be set. States of a model with constraints are guesses (initial = approx). */
static int settable(int kind)
{
    switch (kind) {
    case STATE: return model.project ? INSTANTIATED : INSTANTIATED | INITIALIZATION;
    case INPUT: return ANY & ~TERMINATED;
    case PARAMETER: return INSTANTIATED | INITIALIZATION | EVENT_MODE | STEP;
    default: return 0;
    }
}

static void take(Instance *i, int kind, size_t k, double value)
{
    Head *const h = i->head;
    if (kind == STATE)
        i->given[k] = i->x[k] = value;
    if (kind == INPUT) {
        h->new_u |= i->u[k] != value;
        i->u[k] = value;
    }
    if (kind == PARAMETER) {
        h->new_p |= i->p[k] != value;
        i->p[k] = value;
    }
    h->settled = 0;
}

/* All of it or nothing. */
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[], size_t count)
{
    size_t k, place;
    CHECK(BOTH, ANY & ~TERMINATED);
    if (n != count || (n && (!references || !values)))
        return refused(i, __func__, "as many values as value references are needed");
    for (k = 0; k < n; k++) {
        const int kind = kind_of(references[k], &place);
        if (!(settable(kind) & i->head->mode))
            return say(i, fmi3Error, "the variable with value reference %u cannot be set here", (unsigned)references[k]);
    }
    if (!all_finite(values, n))
        return refused(i, __func__, "a value is infinite or not a number");
    for (k = 0; k < n; k++) {
        const int kind = kind_of(references[k], &place);
        take(i, kind, place, values[k]);
    }
    forget(i);
    return fmi3OK;
}

static fmi3Status none_of(Instance *i, const char *call, size_t n)
{
    return !i ? fmi3Error : n ? refused(i, call, "there is no variable of this type") : fmi3OK;
}

#define DEFINED(TYPE) \
    fmi3Status fmi3Get##TYPE(REFERENCES, fmi3##TYPE values[], size_t count) \
    { \
        (void)references, (void)values; \
        return none_of(instance, __func__, n + count); \
    } \
    fmi3Status fmi3Set##TYPE(REFERENCES, const fmi3##TYPE values[], size_t count) \
    { \
        (void)references, (void)values; \
        return none_of(instance, __func__, n + count); \
    }
OTHER_TYPES(DEFINED)

fmi3Status fmi3GetBinary(REFERENCES, size_t sizes[], fmi3Binary values[], size_t count)
{
    (void)references, (void)sizes, (void)values;
    return none_of(instance, __func__, n + count);
}

fmi3Status fmi3SetBinary(REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t count)
{
    (void)references, (void)sizes, (void)values;
    return none_of(instance, __func__, n + count);
}

fmi3Status fmi3GetClock(REFERENCES, fmi3Clock values[])
{
    (void)references, (void)values;
    return none_of(instance, __func__, n);
}

fmi3Status fmi3SetClock(REFERENCES, const fmi3Clock values[])
{
    (void)references, (void)values;
    return none_of(instance, __func__, n);
}
