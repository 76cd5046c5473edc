/* Model Exchange: states, rates, event indicators, completed steps. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    CHECK(EXCHANGE, EVENT_MODE | CONTINUOUS);
    if (!all_finite(&time, 1))
        return refused(i, __func__, "time has to be finite");
    if (time != i->head->t)
        forget(i);
    i->head->t = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n)
{
    CHECK(EXCHANGE, CONTINUOUS);
    if (n != model.states || (n && !states))
        return refused(i, __func__, "wrong number of states");
    if (!all_finite(states, n))
        return say(i, fmi3Discard, "%s: a state is infinite or not a number", __func__);
    if (!same(i->x, states, n))
        forget(i);
    copy(i->x, states, n);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t n)
{
    fmi3Status status;
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !states))
        return refused(i, __func__, "wrong number of states");
    if ((status = settled(i)) == fmi3OK)
        copy(states, i->x, n);
    return status;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t n)
{
    fmi3Status status;
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !derivatives))
        return refused(i, __func__, "wrong number of states");
    if ((status = rates(i)) == fmi3OK)
        copy(derivatives, i->rates, n);
    return status;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n)
{
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !nominals))
        return refused(i, __func__, "wrong number of states");
    copy(nominals, model.nominal, n);
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    CHECK(EXCHANGE, ANY);
    if (!n)
        return fmi3Error;
    *n = model.states;
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t n)
{
    double *g;
    fmi3Status status = fmi3OK;
    CHECK(EXCHANGE, READABLE);
    if (n != model.events || (n && !indicators))
        return refused(i, __func__, "wrong number of event indicators");
    if (n && (status = group(i, model.groups - 1, &g)) == fmi3OK)
        copy(indicators, g, n);
    return status;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    CHECK(EXCHANGE, ANY);
    if (!n)
        return fmi3Error;
    *n = model.events;
    return fmi3OK;
}

/* Whether the state has drifted from its constraints. */
static int drifted(Instance *i)
{
    double worst = 0.0;
    size_t k;
    if (!model.project || !model.constraints || model.constraints(i->head->t, i->x, i->u, i->p, i->seed))
        return 0;
    for (k = 0; k < model.violations; k++)
        worst = fmax(worst, fabs(i->seed[k]));
    return worst > PROJECTED_FROM * i->head->rtol;
}

/* Whether an event that is to end the motion is on this side now, and was not when it was last looked at. */
static int stops_at(const Instance *i, size_t k, double sign)
{
    const double change = sign - i->sign[k];
    return model.stop[k] && i->sign[k] != 0.0 && change * (model.direction[k] ? model.direction[k] : change) > 0.0;
}

/* Whether one is. */
static void stopping(const Instance *i, const double *sign, fmi3Boolean *stop)
{
    size_t k;
    for (k = 0; k < model.events; k++)
        *stop = *stop || stops_at(i, k, sign[k]);
}

/* Whether one will be within what importers find times of events to. They may hand out the near side of a crossing, and ask for no
   other event until the motion comes back. */
static void imminent(Instance *i, fmi3Boolean *stop)
{
    const Head *const h = i->head;
    const double soon = SOON * (fabs(h->t) + h->step);
    double *const g = i->seed;
    size_t k;
    if (!model.events || !(h->step > 0.0) || rates(i) != fmi3OK)
        return;
    for (k = 0; k < model.states; k++)
        i->reserve[k] = i->x[k] + soon * i->rates[k];
    if (model.group[model.groups - 1].values(h->t + soon, i->reserve, i->u, i->p, g))
        return;
    for (k = 0; k < model.events; k++)
        g[k] = side(i, k, g);
    stopping(i, g, stop);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_way_back, fmi3Boolean *event, fmi3Boolean *terminate)
{
    fmi3Boolean stop = false;
    CHECK(EXCHANGE, CONTINUOUS);
    (void)no_way_back;
    if (!event || !terminate)
        return fmi3Error;
    i->head->step = i->head->t - i->head->seen;
    i->head->seen = i->head->t;
    if (sides(i, i->seed) == fmi3OK)
        stopping(i, i->seed, &stop);
    *event = drifted(i) || stop;
    *terminate = false;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no discrete states");
}

/* Whether an event that is to end the motion happened since the last time. */
static fmi3Status ended(Instance *i, fmi3Boolean *terminate)
{
    double *const sign = i->seed;
    const fmi3Status status = sides(i, sign);
    if (status != fmi3OK)
        return status;
    stopping(i, sign, terminate);
    copy(i->sign, sign, model.events);
    imminent(i, terminate);
    return status;
}

/* The state back on its constraints, where it drifted or these are other ones. */
static void returned(Instance *i, fmi3Boolean *changed)
{
    if (!i->head->new_p && !drifted(i))
        return;
    if (projected(i, i->x, i->reserve)) {
        say(i, fmi3Warning, "the state is not on its constraints, and none near it is");
        return;
    }
    *changed = !same(i->x, i->reserve, model.states);
    copy(i->x, i->reserve, model.states);
    if (*changed)
        forget(i);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals_changed,
    fmi3Boolean *states_changed, fmi3Boolean *has_next_event, fmi3Float64 *next_event)
{
    CHECK(EXCHANGE, EVENT_MODE);
    if (!again || !terminate || !nominals_changed || !states_changed || !has_next_event || !next_event)
        return fmi3Error;
    *again = *terminate = *nominals_changed = *states_changed = *has_next_event = false;
    returned(i, states_changed);
    i->head->new_u = i->head->new_p = 0;
    return ended(i, terminate);
}
