/* Modes of an FMU: initialization, events, continuous time, the end. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* On which side of zero an event is, by its function; where that is zero, where it was. */
static double side(const Instance *i, size_t k, const double *g)
{
    return g[k] > 0.0 ? 1.0 : g[k] < 0.0 ? -1.0 : i->sign[k];
}

static fmi3Status sides(Instance *i, double *sign)
{
    double *g;
    size_t k;
    fmi3Status status;
    if (!model.events)
        return fmi3OK;
    if ((status = group(i, model.groups - 1, &g)) != fmi3OK)
        return status;
    for (k = 0; k < model.events; k++)
        sign[k] = side(i, k, g);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean has_stop, fmi3Float64 stop)
{
    Head *h;
    CHECK(BOTH, INSTANTIATED);
    h = i->head;
    if (!all_finite(&start, 1) || (has_stop && !(stop >= start)))
        return refused(i, __func__, "times have to be finite, and the stop not before the start");
    if (has_tolerance && !(tolerance > 0.0 && all_finite(&tolerance, 1)))
        return refused(i, __func__, "the tolerance has to be above zero");
    if (has_tolerance) {
        h->rtol = tolerance;
        h->atol = tolerance * (model.atol / model.rtol);
    }
    h->t = h->seen = start;
    h->has_stop = has_stop;
    h->stop = has_stop ? stop : 0.0;
    h->mode = INITIALIZATION;
    h->settled = 0;
    forget(i);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    fmi3Status status;
    CHECK(BOTH, INITIALIZATION);
    status = settled(i);
    if (status == fmi3OK)
        status = sides(i, i->sign);
    if (status != fmi3OK)
        return fmi3Error;
    i->head->mode = i->head->kind == EXCHANGE ? EVENT_MODE : STEP;
    i->head->new_u = i->head->new_p = 0;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    CHECK(EXCHANGE, CONTINUOUS);
    i->head->mode = EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    CHECK(EXCHANGE, EVENT_MODE);
    i->head->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no Event Mode in Co-Simulation");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no structural parameters");
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    CHECK(BOTH, INITIALIZED);
    i->head->mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    CHECK(BOTH, ANY);
    begin(i, i->head->kind);
    return fmi3OK;
}
