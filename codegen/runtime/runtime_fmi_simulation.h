/* Co-Simulation: a step is a call of simulate. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* Makes a step from the state on, with what was set since the last one. */
static int stepped(Instance *i, double *time)
{
    Head *const h = i->head;
    int status;
    if (h->new_p) /* other constraints, perhaps, and another slope in any case */
        h->moving = 0;
    if (!h->moving) {
        if (h->new_p && (status = projected(i, i->x, i->reserve)) == 0)
            copy(i->x, i->reserve, model.states);
        model.start(i->simulation, h->t, i->x);
    }
    status = model.go(i->simulation, h->moving && h->new_u, i->u, i->p, h->rtol, h->atol, time, i->x);
    h->moving = 1;
    h->new_u = h->new_p = 0;
    h->t = *time;
    forget(i);
    return status;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean no_way_back, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    double time = from + length;
    Head *h;
    int status;
    CHECK(SIMULATION, STEP);
    h = i->head;
    (void)no_way_back;
    if (!event || !terminate || !early || !reached)
        return fmi3Error;
    *event = *terminate = *early = false;
    *reached = h->t;
    if (!all_finite(&time, 1) || !(length > 0.0) || !(time > h->t))
        return refused(i, __func__, "the communication step size has to be above zero");
    if (!(fabs(from - h->t) <= 1e-6 * length + 1e-12 * fabs(h->t)))
        return say(i, fmi3Error, "%s: the communication point is %.17g, not %.17g", __func__, h->t, from);
    if (h->has_stop && time > h->stop + 1e-6 * length)
        return refused(i, __func__, "the step ends after the stop time");
    status = stepped(i, &time);
    *reached = time;
    *terminate = status == STOPPED;
    *early = status == STOPPED && i->may_return_early; /* where that is not allowed, terminateSimulation and the time say it */
    if (status == 0 || status == STOPPED)
        return fmi3OK;
    return say(i, fmi3Error, "stopped at t = %.17g: %s", time, model.cause(status));
}

fmi3Status fmi3GetOutputDerivatives(REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
{
    (void)references, (void)n, (void)orders, (void)values, (void)count;
    return refused(instance, __func__, "this FMU has no derivatives of outputs");
}
