/* Directional and adjoint derivatives of an FMU. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* A known as its column among x, u, p; -1 for any other variable. */
static long column(fmi3ValueReference reference)
{
    size_t k;
    switch (kind_of(reference, &k)) {
    case STATE: return (long)k;
    case INPUT: return (long)(model.states + k);
    case PARAMETER: return model.jacobian_p && !model.outputs ? (long)(model.states + model.inputs + k) : -1;
    default: return -1;
    }
}

/* An unknown as its row among x', x, the model's outputs; -1 for any other variable. */
static long row(fmi3ValueReference reference)
{
    size_t k;
    switch (kind_of(reference, &k)) {
    case RATE: return (long)k;
    case STATE: return (long)(model.states + k);
    case VARIABLE: return k < model.outputs ? (long)(2 * model.states + k) : -1;
    default: return -1;
    }
}

/* to += the matrix, rows x columns, times `by`; transposed where that is asked for. */
static void add_product(const double *matrix, size_t rows, size_t columns, int transposed, const double *by, double *to)
{
    size_t r, c;
    for (r = 0; r < rows; r++)
        for (c = 0; c < columns; c++)
            to[transposed ? c : r] += matrix[r * columns + c] * by[transposed ? r : c];
}

static int add_matrix(Instance *i, Result matrix, size_t rows, size_t columns, int transposed, const double *by, double *to)
{
    double *values;
    int status;
    if (!matrix || !rows || !columns)
        return 0;
    if (!(values = malloc(rows * columns * sizeof *values)))
        return -1;
    status = matrix(i->head->t, i->x, i->u, i->p, values);
    if (!status)
        add_product(values, rows, columns, transposed, by, to);
    free(values);
    return status;
}

/* x' along (dx, du), or products of x' with y from the left: by the function that has them, else by Jacobians. */
static int of_rates(Instance *i, int transposed, const double *by, double *to)
{
    const size_t nx = model.states, nu = model.inputs, given = transposed ? nx : nx + nu, made = transposed ? nx + nu : nx;
    const Result whole = transposed ? model.adjoint : model.forward;
    double *taken;
    int status;
    if (!whole) {
        if ((status = add_matrix(i, model.jacobian, nx, nx, transposed, by, to)) != 0)
            return status;
        return add_matrix(i, model.jacobian_u, nx, nu, transposed, by + (transposed ? 0 : nx), to + (transposed ? nx : 0));
    }
    if (!(taken = malloc((nx + given + made + 1) * sizeof *taken)))
        return -1;
    copy(taken, i->x, nx);
    copy(taken + nx, by, given);
    status = whole(i->head->t, taken, i->u, i->p, taken + nx + given);
    if (!status)
        copy(to, taken + nx + given, made);
    free(taken);
    return status;
}

/* All results from all seeds: over (x, u, p) and (x', x, outputs), or the other way. */
static int derived(Instance *i, int transposed)
{
    const size_t nx = model.states, np = model.parameters, nu = model.inputs;
    double *const columns = transposed ? i->result : i->seed, *const rows = transposed ? i->seed : i->result;
    const double *const by = i->seed;
    int status = of_rates(i, transposed, by, i->result);
    size_t k;
    if (status)
        return status;
    for (k = 0; k < nx; k++)
        *(transposed ? columns + k : rows + nx + k) += transposed ? rows[nx + k] : columns[k];
    status = add_matrix(i, model.outputs_jacobian, model.outputs, nx, transposed, transposed ? rows + 2 * nx : columns, transposed ? columns : rows + 2 * nx);
    if (status || model.outputs)
        return status;
    return add_matrix(i, model.jacobian_p, nx, np, transposed, transposed ? rows : columns + nx + nu, transposed ? columns + nx + nu : rows);
}

/* From seeds of some variables to sensitivities of others. */
static fmi3Status derivative(Instance *i, const char *call, int transposed, const fmi3ValueReference from[], size_t n_from,
    const fmi3ValueReference to[], size_t n_to, const double *seed, double *sensitivity)
{
    const size_t wide = 2 * model.states + model.inputs + model.parameters + variables();
    fmi3Status status = settled(i);
    size_t k;
    if (!(model.forward && model.adjoint) && !model.jacobian)
        return refused(i, call, "this FMU was made without derivatives");
    if (i->head->mode == INITIALIZATION && model.project)
        return refused(i, call, "the start values of this model are guesses: there are no derivatives by them");
    if (status != fmi3OK)
        return status;
    for (k = 0; k < n_from + n_to; k++) {
        const int is_from = k < n_from;
        const fmi3ValueReference reference = is_from ? from[k] : to[k - n_from];
        if ((is_from != transposed ? column(reference) : row(reference)) < 0)
            return say(i, fmi3Error, "%s: no derivatives of or by the variable with value reference %u", call, (unsigned)reference);
    }
    if (!all_finite(seed, n_from))
        return refused(i, call, "a seed is infinite or not a number");
    memset(i->seed, 0, 2 * wide * sizeof *i->seed);
    for (k = 0; k < n_from; k++)
        i->seed[transposed ? row(from[k]) : column(from[k])] += seed[k];
    status = judged(i, derived(i, transposed), "derivatives");
    for (k = 0; k < n_to && status == fmi3OK; k++)
        sensitivity[k] = i->result[transposed ? column(to[k]) : row(to[k])];
    return status;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity)
{
    CHECK(BOTH, INITIALIZATION | INITIALIZED);
    if (n_seed != n_knowns || n_sensitivity != n_unknowns)
        return refused(i, __func__, "a seed for every known and a sensitivity for every unknown are needed");
    return derivative(i, __func__, 0, knowns, n_knowns, unknowns, n_unknowns, seed, sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity)
{
    CHECK(BOTH, INITIALIZATION | INITIALIZED);
    if (n_seed != n_unknowns || n_sensitivity != n_knowns)
        return refused(i, __func__, "a seed for every unknown and a sensitivity for every known are needed");
    return derivative(i, __func__, 1, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *n)
{
    (void)reference, (void)n;
    return refused(instance, __func__, "dependencies do not change");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
    fmi3ValueReference independents[], size_t independent_elements[], fmi3DependencyKind kinds[], size_t n)
{
    (void)dependent, (void)elements, (void)independents, (void)independent_elements, (void)kinds, (void)n;
    return refused(instance, __func__, "dependencies do not change");
}
