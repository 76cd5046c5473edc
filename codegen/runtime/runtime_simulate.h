/* The motion: step after step to the output times.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if HAS_CHOICES || FRAME
/* Whether v is the same after a change of what w is measured along. */
static int is_same(const double *v, const double *after)
{
    double most = 0.0, off = 0.0;
    int i;
    for (i = 0; i < VELOCITY_ROWS; i++) {
        most = fmax(most, fabs(v[i]));
        off = fmax(off, fabs(after[i] - v[i]));
    }
    return off <= SHARED(1e-6, 2.2e-3) * most;
}
#endif

#if HAS_CHOICES
static const struct Chart *here(const Run *r)
{
    return charts + r->s->choice;
}

/* The generalized velocities v at y, and the state in the coordinates of chart 0. */
static int deliver(const Run *r, const double *y, double *x, double *v)
{
    int i, status = here(r)->velocity(r->s->t, y, r->u, r->p, v);
    if (status == OK && here(r) != charts)
        return MODEL_transform(r->s->choice, 0, r->s->t, y, r->u, r->p, x);
    for (i = 0; i < NX; i++)
        x[i] = y[i];
    return status;
}

/* Goes on in chart `to`: the state is carried over exactly; its slope is made anew, as is what belongs to the old coordinates: what the
   guards remember and the error that the step control compares with. Changes nothing but the count of calls and returns 0 where that
   fails, or v would be another: where constraints depend on each other no chart holds it. */
static int enter(Run *r, int to)
{
    Simulation *const s = r->s, old;
    int ok;
#if HAS_GUARDS
    double seen[GUARDS];
    int crossed, i;
#endif
    double v[VELOCITY_ROWS], after[VELOCITY_ROWS];
    if (to == s->choice)
        return 0;
    old = *s;
    ok = here(r)->velocity(s->t, old.x, r->u, r->p, v) == OK;
    ok = ok && MODEL_transform(s->choice, to, s->t, old.x, r->u, r->p, s->x) == OK;
    s->choice = to;
    ok = ok && here(r)->velocity(s->t, s->x, r->u, r->p, after) == OK && is_same(v, after);
#if HAS_GUARDS
    for (i = 0; i < GUARDS; i++)
        s->guard[i] = s->guard_size[i] = s->guard_rate[i] = 0.0;
    ok = ok && looked(r, s->t, 0.0, s->x, seen, &crossed) == OK;
#endif
    ok = ok && slope(r, s->t, s->x, s->slope) == OK;
    if (!ok) {
        const long calls = s->calls;
        *s = old;
        s->calls = calls;
        return 0;
    }
#if HAS_GUARDS
    remember(r, 0.0, seen);
#endif
#if COLLOCATION_STAGES
    s->collocated_h = 0.0; /* no polynomial to go on along */
#endif
#if HIGHEST_ORDER
    s->expanded = 0;
#endif
    s->error = 1e-4;
    s->switches++;
    return 1;
}

/* Where a step failed: goes on in the best chart if that is so much better here. */
static int rescued(Run *r)
{
    const Simulation *const s = r->s;
    const int best = MODEL_chart(-1, s->t, s->x, r->u, r->p);
    return MODEL_margin(best, s->t, s->x, r->u, r->p) > MARGIN_BETTER * MODEL_margin(s->choice, s->t, s->x, r->u, r->p) && enter(r, best);
}
#endif

#if HAS_GUARDS
/* Whether state and slope that another way from `other` led to are z and its slope `next`, within the tolerance; rates of coordinates to ten times
   that and to 1e-7: small errors of quasi-velocities are large ones of these where the choice is singular, and passages add up. */
static int agrees(const Run *r, const double *again, const double *last, const double *other, const double *z, const double *next, double speed)
{
    double off[N], differ = 0.0;
    int i;
    for (i = 0; i < N; i++)
        off[i] = again[i] - z[i];
    for (i = 0; i < NQ; i++)
        differ = fmax(differ, fabs(last[i] - next[i]));
    return norm(r, off, other, z) <= 1.0 && differ <= fmin(10.0 * r->rtol, ROUNDED(1e-7)) * speed;
}

/* Whether the motion from y to z may be believed. Over a singular position other steps are made: on the right branch, where the motion
   is smooth, two ways agree and velocities do not jump. The step is made again in two, cut in up to three places, for one of these could
   come too close. Where stages are on the constraints, and little but rounding is left, up to five more, and last a step goes back
   from z: the method is explicit, so that it retraces nothing. */
static int passed(Run *r, const Method *method, double t, double h, double end, const double *y, const double *own, const double *z, const double *next, double *seen)
{
    static const double cuts[] = {0.37, 0.61, 0.23, 0.5, 0.78, 0.44, 0.69, 0.3};
    const void *const m = method->coefficients;
    double middle[N], bend[N], again[N], last[N], error, jump = 0.0, speed = 0.0;
    int i, crossed, believed = 0, status = looked(r, end, h, z, seen, &crossed);
    size_t n, most = 3;
    if (status != OK || !crossed)
        return status;
    for (i = 0; i < NQ; i++) {
        jump = fmax(jump, fabs(next[i] - own[i]));
        speed = fmax(speed, fabs(own[i]));
    }
    if (jump > 0.8 * speed)
        return SINGULAR_POSITION;
#if HAS_PROJECT
    most = r->passing ? sizeof cuts / sizeof *cuts : most;
#endif
    for (n = 0; n < most && !believed; n++) {
        const double cut = t + cuts[n] * h;
        believed = method->step(r, m, t, cut - t, y, own, middle, bend, &error) == OK && settled(r, cut, middle, bend) == OK &&
                   method->step(r, m, cut, end - cut, middle, bend, again, last, &error) == OK && settled(r, end, again, last) == OK &&
                   agrees(r, again, last, y, z, next, speed);
    }
    if (!believed && most > 3)
        believed = method->step(r, m, end, t - end, z, next, again, last, &error) == OK &&
                   settled(r, t, again, last) == OK && agrees(r, again, last, z, y, own, speed);
    r->s->crossings += believed;
    return believed ? OK : SINGULAR_POSITION;
}
#endif

#if FRAME
/* The state at y measured along the frame in `fresh`, w' = N'^T v; v, in `moving` between q and z, has to stay the same. */
static int carried(const Run *r, const double *before, const double *fresh, double *y)
{
    double moving[NQ + VELOCITY_ROWS + NZ], after[VELOCITY_ROWS];
    int i, status;
    for (i = 0; i < NQ; i++)
        moving[i] = y[i];
    for (i = 0; i < NZ; i++)
        moving[NQ + VELOCITY_ROWS + i] = y[NX - NZ + i];
    status = MODEL_velocity_framed(r->s->t, y, r->u, before, moving + NQ);
    if (status != OK || (status = MODEL_state_framed(r->s->t, moving, r->u, fresh, y)) != OK ||
        (status = MODEL_velocity_framed(r->s->t, y, r->u, fresh, after)) != OK)
        return status;
    return is_same(moving + NQ, after) ? OK : SINGULAR_POSITION;
}

/* Bases the frame anew where a direction of it has less than `bound` left on the allowed motions. A state that is measured along it goes
   with it: v is the same, w' = N'^T v. Changes nothing but the count of calls and returns 0 where that fails. */
static int rebased(Run *r, double bound)
{
    Simulation *const s = r->s, old;
    double fresh[PARAMETERS], before[PARAMETERS];
    const int measured = IS_FRAMED(r);
    int i, ok;
#if HAS_GUARDS
    double seen[GUARDS];
    int crossed;
#endif
    if (!(MODEL_frame(s->t, s->x, r->u, r->p) < bound) || MODEL_rebase(s->t, s->x, r->u, r->p, fresh) != OK)
        return 0;
    old = *s;
    for (i = 0; i < PARAMETERS; i++)
        before[i] = r->data[i];
    ok = !measured || carried(r, before, fresh, s->x) == OK;
    for (i = 0; i < PARAMETERS; i++)
        r->data[i] = fresh[i];
#if HAS_GUARDS
    for (i = 0; measured && i < GUARDS; i++)
        s->guard[i] = s->guard_size[i] = s->guard_rate[i] = 0.0;
    ok = ok && (!measured || looked(r, s->t, 0.0, s->x, seen, &crossed) == OK);
#endif
    ok = ok && (!measured || slope(r, s->t, s->x, s->slope) == OK);
    if (!ok) {
        const long calls = s->calls;
        *s = old;
        s->calls = calls;
        for (i = 0; i < PARAMETERS; i++)
            r->data[i] = before[i];
        return 0;
    }
#if HAS_GUARDS
    if (measured)
        remember(r, 0.0, seen);
#endif
#if COLLOCATION_STAGES
    s->collocated_h = 0.0; /* no polynomial to go on along */
#endif
#if HIGHEST_ORDER
    s->expanded = 0;
#endif
    for (i = 0; i < FRAME; i++)
        s->frame[i] = r->data[PARAMETERS - FRAME + i];
    s->bases++;
    return 1;
}

/* The frame in force: that of p at the start, later that of the simulation. */
static void framed(Run *r, const double *p)
{
    Simulation *const s = r->s;
    const int fresh = s->next_step == 0.0 && s->done == 0;
    int i;
    for (i = 0; i < PARAMETERS; i++)
        r->data[i] = p[i];
    for (i = 0; i < FRAME; i++)
        if (fresh)
            s->frame[i] = p[PARAMETERS - FRAME + i];
        else
            r->data[PARAMETERS - FRAME + i] = s->frame[i];
}
#endif

/* A status with more to say: whether the choice alone is singular where the motion stopped, or the constraints as well. */
static int told(const Run *r, int status)
{
    const Simulation *const s = r->s;
    int i;
#if HAS_ROWS
    double independence;
#endif
    if (status != SINGULAR_POSITION && status != SINGULAR)
        return status;
    for (i = 0; i < NX; i++)
        if (!(s->x[i] - s->x[i] == 0.0))
            return NOT_FINITE;
#if HAS_ROWS
    independence = MODEL_independence(s->t, s->x, r->u, r->p);
    if (independence > INDEPENDENT)
        return SINGULAR_CHOICE;
    return independence <= INDEPENDENT ? SINGULAR_POSITION : status;
#else
    return status;
#endif
}

#if KINKS /* a motion that begins at one goes on with what is behind it */
#define FIRST_MOMENT(t, span) (64.0 * DBL_EPSILON * fmax(fabs(t), span))
#else
#define FIRST_MOMENT(t, span) 0.0
#endif

/* The slope at the start and the first step size. */
static int start(Run *r, const Method *method, double span)
{
    Simulation *const s = r->s;
    int status;
#if HAS_GUARDS
    double seen[GUARDS];
    int crossed;
    if ((status = looked(r, s->t, 0.0, s->x, seen, &crossed)) != OK)
        return status;
    remember(r, 0.0, seen);
#endif
#if FRAME
    rebased(r, FRAME_WORN);
#endif
#if HAS_COORDINATES
    if (on_coordinates(r) && (status = charted(r, s->t, s->x)) != OK)
        return status;
#endif
#if HAS_MANIFOLD
    {
        double F[MANIFOLD * WIDE];
        int i;
        if ((status = missed(r, s->t, s->x, F)) != OK)
            return status;
        for (i = 0; i < HELD; i++)
            s->held[i] = F[(MANIFOLD - HELD + i) * WIDE];
    }
#endif
    if ((status = slope(r, s->t + FIRST_MOMENT(s->t, span), s->x, s->slope)) != OK)
        return status;
    if (s->step_size > 0.0)
        s->next_step = s->step_size;
    else
        s->next_step = method->prepare ? span : first_step(r, method->order, span);
#if HIGHEST_ORDER
    s->expanded = 0;
#endif
#if KINKS
    s->landed = 0;
#endif
    s->error = 1e-4;
    watch(r);
    return s->events ? events_begin(r) : OK;
}

/* A step that met the tolerance becomes the state. */
static void accept(Run *r, double h, double end, const double *z, const double *next, const double *seen)
{
    Simulation *const s = r->s;
    int i;
    s->steps++;
    s->t = end;
#if HAS_GUARDS
    remember(r, h, seen);
#else
    (void)h, (void)seen;
#endif
    for (i = 0; i < N; i++) {
        s->x[i] = z[i];
        s->slope[i] = next[i];
    }
#if HIGHEST_ORDER
    s->expanded = 0;
#endif
#if TURNING
    unwind(s);
#endif
    watch(r);
#if HAS_COORDINATES
    if (on_coordinates(r))
        renewed(r, s->t, s->x, r->worn);
#endif
#if FRAME
    rebased(r, FRAME_WORN);
#endif
#if HAS_CHOICES
    enter(r, MODEL_chart(s->choice, s->t, s->x, r->u, r->p));
#endif
}

/* A start, or what goes on with other inputs. */
static int ready(Run *r, const Method *method, double span)
{
    if (r->s->next_step == 0.0)
        return start(r, method, span);
#if HAS_INPUTS
    if (r->s->stale)
        return resumed(r);
#endif
    return OK;
}

#if HAS_GUARDS && HAS_PROJECT
/* Whether a guard would vanish within h if it went on as in the last step: an explicit step there has its stages on the constraints. */
static int is_passing(const Run *r, const Method *method, double h)
{
    const Simulation *const s = r->s;
    int i, passing = 0;
    for (i = 0; i < GUARDS_HERE(r); i++)
        passing |= s->guard_size[i] > 0.0 && fabs(s->guard[i]) + 1.2 * h * fmin(s->guard_rate[i], 0.0) < 0.0;
    return passing && s->enforcement == PROJECTION && IS_EXPLICIT(method);
}
#endif

/* One step towards a time, `left` away, of size h: accepted, or next_step becomes shorter. Returns why a step by equal
   steps failed; `failed` becomes the status of the last step that had to be made shorter. */
static int advance(Run *r, const Method *method, double time, double left, double h, int *failed)
{
    Simulation *const s = r->s;
    const int fixed = s->step_size > 0.0;
    const double t = s->t;
    int last = h >= left;
    double end = last ? time : t + h, z[N], next[N], error, ratio, most = 5.0; /* that a step may be made shorter by */
    int stops = 0, crossed = 0;
#if KINKS
    Trial trial = {h, end, 0.0, 0.0, z, next, 0};
#endif
#if HAS_GUARDS
    Dense *const dense = r->dense;
    const long crossings = s->crossings;
    double seen[GUARDS];
#else
    const double *const seen = NULL;
#endif
    int status;
#if HAS_GUARDS && HAS_PROJECT
    r->passing = is_passing(r, method, h);
#endif
    status = method->step(r, method->coefficients, t, h, s->x, s->slope, z, next, &error);
#if HAS_INPUTS
    if (r->inputs && r->refused)
        return NO_INPUT;
#endif
    if (fixed)
        error = 0.0;
#if KINKS
    if (status == OK || fixed) {
        trial.error = error;
        status = before_kink(r, method, status, &trial);
        last &= trial.kink || trial.h == h; /* one that ends before its time says how long the next may be */
        h = trial.h, end = trial.end, error = fixed ? 0.0 : trial.error;
        last |= trial.kink; /* the size that was wanted is that of the next one, too */
    }
#endif
    if (status == OK && error <= 1.0)
        status = settled(r, end, z, next);
#if HAS_COORDINATES
    if (on_coordinates(r)) {
        r->worn = status == OK && error <= 1.0 ? worn(r, end, z) : FRESH;
        if ((status != OK || r->worn == STRAYED) && recharted(r)) {
            s->rejected++;
            return OK;
        }
        if (r->worn == STRAYED && (!fixed || s->enforcement == SELECTIVE)) /* equal steps cannot be shorter */
            status = SINGULAR;
    }
#endif
#if HAS_GUARDS
    r->dense = NULL; /* it stays that of this step */
    if (status == OK && error <= 1.0)
        status = passed(r, method, t, h, end, s->x, s->slope, z, next, seen);
    r->dense = dense;
    crossed = s->crossings > crossings;
#endif
#if HAS_GUARDS && HAS_PROJECT
    if (status != OK || !(error <= 1.0)) { /* by rounding, where a stage came too close; much shorter steps would end there */
        most = r->passing ? 1.15 : most;
        r->passing = 0;
    }
#endif
#if FRAME
    if (status != OK && rebased(r, NEARLY_BASED)) {
        s->rejected++;
        return OK;
    }
#endif
#if HAS_CHOICES
    if (status != OK && rescued(r)) {
        s->rejected++;
        return OK;
    }
#endif
    if (fixed && status != OK)
        return status;
    *failed = status;
    if (status != OK || !(error <= 1.0)) { /* too long, or a place without a value on the way */
        ratio = status == OK ? pow(error, method->grow) / method->safety : 4.0;
        s->next_step = h / fmin(ratio, most);
        s->rejected++;
        s->error = -fabs(s->error); /* the next step must not grow */
        return OK;
    }
    if (s->events) {
        status = events_inside(r, method, h, crossed, &end, z, next);
        stops = status == EVENT;
        if (status != OK && !stops)
            return status;
#if HAS_GUARDS
        if (stops && (status = looked(r, end, end - t, z, seen, &crossed)) != OK)
            return status;
#endif
    }
#if KINKS
    if (trial.kink && !stops) {
        trial.h = h;
        status = across_kink(r, time, &trial);
        h = trial.h, end = trial.end;
        stops = status == EVENT;
        if (status != OK && status != JUMP && !stops)
            return status;
#if HAS_GUARDS
        if (stops && (status = looked(r, end, end - t, z, seen, &crossed)) != OK)
            return status;
#endif
        status = stops ? OK : status;
    }
#endif
    if (!fixed && !method->prepare) {
        ratio = shrinkage(s, error, method);
        if (!last || h / ratio > s->next_step)
            s->next_step = h / ratio;
        s->error = fmax(error, 1e-4);
    }
#if HAS_GUARDS && HAS_PROJECT
    r->passing = 0;
#endif
    accept(r, stops ? end - t : h, end, z, next, seen);
#if KINKS
    s->landed = stops ? 0 : trial.kink;
    if (s->landed) {
        s->landings++;
        if (!fixed && !method->prepare) /* what comes may be another kind of motion */
            s->next_step = first_step(r, method->order, s->next_step);
    }
#endif
    if (status != OK)
        return status; /* a blow, just behind the state */
    return stops ? EVENT : OK;
}

/* Where the rows at the output times go; v and chart only where the module has several charts, reduced where angles go round (it may
   be NULL), frame where it has one. */
typedef struct {
    double *x, *work, *v, *chart, *reduced, *frame;
} Rows;

static int deliver_row(const Run *r, const Rows *rows, size_t row)
{
    const Simulation *const s = r->s;
    double *const x = rows->x + row * NX;
#if FRAME
    int k;
    for (k = 0; k < FRAME; k++)
        rows->frame[row * FRAME + (size_t)k] = s->frame[k];
#endif
#if HAS_CHOICES
    const int status = deliver(r, s->x, x, rows->v + row * VELOCITY_ROWS);
    if (status != OK)
        return status;
    rows->chart[row] = s->choice;
#else
    int i;
    for (i = 0; i < NX; i++)
        x[i] = s->x[i];
#endif
#if TURNING
    wind(s, x, rows->reduced ? rows->reduced + row * NX : NULL);
#endif
    if (rows->work)
        rows->work[row] = s->x[NX];
    return OK;
}

/* Goes on to n increasing output times for at most `budget` steps. */
static int run_to(Run *r, const Method *method, size_t n, const double *times, long budget, const Rows *rows)
{
    Simulation *const s = r->s;
    int status, failed = OK;
#if TURNING
    unwind(s);
#endif
    for (; (size_t)s->done < n; s->done++) {
        const double time = times[s->done];
        while (s->t < time) {
#if HAS_INPUTS
            const double end = until(r, time), left = end - s->t;
#else
            const double end = time, left = end - s->t;
#endif
            double h;
            if ((status = ready(r, method, times[n - 1] - s->t)) != OK)
                return told(r, status);
            if (s->events && !has_room(s->events))
                return FULL;
            if (budget-- <= 0)
                return MORE;
            if (method->prepare && (status = method->prepare(r)) != OK)
                return told(r, status);
            h = next_size(s, left);
            if (too_short(s, h, left, times[n - 1]))
                return failed ? told(r, failed) : STEP_TOO_SMALL;
            if (sizeof(double) < 8 && h < left)
                h = (s->t + h) - s->t; /* what time really moves by: its last digit may be no small part of h */
            if ((status = advance(r, method, end, left, h, &failed)) != OK)
                return told(r, status);
#if HAS_INPUTS
            if ((status = behind_knot(r)) != OK)
                return told(r, status);
#endif
        }
        if ((status = deliver_row(r, rows, (size_t)s->done)) != OK)
            return status;
    }
    return OK;
}
