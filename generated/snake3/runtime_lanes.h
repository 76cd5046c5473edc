/* Many motions, LANES of them side by side: each lane has its own step size, its own acceptance and its own end, and is refilled from
   the queue. What is seldom (an angle that is too large, a pivot near zero, a guard that is crossed) is done by the loop for one
   motion, a step at a time, so that rows are those of that loop to rounding.

   Entry i of lane l stands at [i * LANES + l]. Functions NAME_lanes take arrays of that kind and add to stray[l] where a lane is not
   plain.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <stdint.h>
#include <string.h>

/* The motions from rows of x, u and p; strides are distances between rows, 0 to use one row for all. */
typedef struct {
    Simulation s;
    Run run;
    const double *times;
    Rows rows; /* of this motion */
    int failed; /* status of the last step that had to be made shorter */
    uint64_t failed_at; /* and how many steps had been tried then */
#if FRAME
    double data[PARAMETERS];
#endif
} Motion;

/* The start of motion number `row`. Returns a status. */
static int begin(const Motions *all, size_t row, Motion *m, double *c)
{
    const double *const x = all->x + (ptrdiff_t)row * all->x_stride;
    const size_t place = row * all->n;
    const Simulation empty = {0};
    int i;
    if (all->simulations)
        m->s = all->simulations[row];
    else {
        m->s = empty;
        m->s.integrator = all->integrator;
        m->s.enforcement = all->enforcement;
        m->s.step_size = all->step_size;
        m->s.t = all->t0[(ptrdiff_t)row * all->t0_stride];
        for (i = 0; i < NX; i++)
            m->s.x[i] = x[i];
#if HAS_CHOICES
        m->s.choice = all->chart;
#endif
    }
    m->run.s = &m->s;
    m->run.u = all->u ? all->u + (ptrdiff_t)row * all->u_stride : NULL;
#if HAS_INPUTS
    m->run.refused = 0;
    fed_by(&m->run, all->inputs ? all->inputs + (ptrdiff_t)row * all->inputs_stride : NULL, m->run.u);
#endif
    m->s.events = all->events ? all->events + row : NULL;
    m->run.p = all->p ? all->p + (ptrdiff_t)row * all->p_stride : NULL;
#if HAS_GUARDS && HAS_PROJECT
    m->run.passing = 0;
#endif
    m->run.rtol = all->rtol;
    m->run.atol = all->atol;
    m->times = all->times + (ptrdiff_t)row * all->times_stride;
    m->failed = OK;
    m->failed_at = 0;
    m->rows.x = all->x_out + place * NX;
    m->rows.work = all->work_out ? all->work_out + place : NULL;
    m->rows.v = all->v_out ? all->v_out + place * VELOCITY_ROWS : NULL;
    m->rows.chart = all->chart_out ? all->chart_out + place : NULL;
    m->rows.reduced = all->reduced_out ? all->reduced_out + place * NX : NULL;
    m->rows.frame = all->frame_out ? all->frame_out + place * FRAME : NULL;
#if FRAME
    m->run.data = m->data;
    framed(&m->run, m->run.p);
    m->run.p = m->data;
#endif
#if HAS_CONSTANTS
    m->run.c = c;
    return MODEL_precompute(m->run.p, c);
#else
    (void)c;
    return OK;
#endif
}

/* A row that is not reached becomes NaN. */
static void empty_row(const Rows *rows, size_t k)
{
    int i;
    if (rows->work)
        rows->work[k] = NAN;
    for (i = 0; i < NX; i++)
        rows->x[k * NX + (size_t)i] = NAN;
    for (i = 0; rows->reduced && i < NX; i++)
        rows->reduced[k * NX + (size_t)i] = NAN;
    for (i = 0; rows->v && i < VELOCITY_ROWS; i++)
        rows->v[k * VELOCITY_ROWS + (size_t)i] = NAN;
    if (rows->chart)
        rows->chart[k] = -1.0;
    for (i = 0; rows->frame && i < FRAME; i++)
        rows->frame[k * FRAME + (size_t)i] = NAN;
}

/* The end of motion number `row`: its counts, and the rows that are left. Those of a motion that an event stopped are where it stopped. */
static void finish(const Motions *all, size_t row, const Motion *m, int status)
{
    const Simulation *const s = &m->s;
    End *const end = all->ends + row;
    size_t k;
    if (all->simulations)
        all->simulations[row] = *s;
    end->status = status;
    end->t = s->t;
    end->steps = s->steps;
    end->rejected = s->rejected;
    end->calls = s->calls;
    end->crossings = s->crossings;
    end->landings = s->landings;
    end->charts = s->charts;
    end->position_violation = s->position_violation;
    end->velocity_violation = s->velocity_violation;
    end->switches = end->bases = 0;
#if HAS_CHOICES
    end->switches = s->switches;
#endif
#if FRAME
    end->bases = s->bases;
#endif
    for (k = (size_t)s->done; k < all->n; k++)
        if (status != EVENT || deliver_row(&m->run, &m->rows, k) != OK)
            empty_row(&m->rows, k);
}

/* All motions one by one. */
static void one_by_one(const Motions *all, const Method *method)
{
    size_t row;
    for (row = 0; row < all->rows; row++) {
        Motion m;
        Dense dense;
        double c[CONSTANTS + 1];
        int status = begin(all, row, &m, c);
        m.run.dense = all->events ? &dense : NULL;
        if (status == OK)
            status = run_to(&m.run, method, all->n, m.times, all->budget - m.s.steps - m.s.rejected, &m.rows);
        finish(all, row, &m, status);
    }
}

#define SIDE_BY_SIDE (HAS_LANES && (EXPLICIT_STAGES || HAS_LANES_TAYLOR))
#if !HAS_LANES_TAYLOR
#define SERIES_ROOM 0
#endif

#if HAS_INPUTS && (SIDE_BY_SIDE || HIGHEST_ORDER)
/* Does a callback give any of the inputs? */
static int any_calls(const Motions *all)
{
    size_t row;
    for (row = 0; all->inputs && row < (all->inputs_stride ? all->rows : 1); row++)
        if (all->inputs[row].call)
            return 1;
    return 0;
}
#endif

#if SIDE_BY_SIDE

#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed between functions of this file alone */

/* Without AVX gcc notes that it passes vectors of this alignment otherwise since 4.6, and warns of clones, which the pragma does not
   reach. Registers are of 16 bytes there, so that no more alignment is needed. */
#if defined(__SSE2__) && !defined(__AVX__)
#define ALIGNED aligned(16),
#else
#define ALIGNED
#endif
#if defined(__SSE2__) && !defined(__AVX__) && !defined(__clang__)
#define OWN static inline __attribute__((noclone))
#else
#define OWN static inline
#endif

typedef double Vector __attribute__((vector_size(8 * LANES), ALIGNED may_alias));
typedef uint64_t Bits __attribute__((vector_size(8 * LANES), ALIGNED may_alias)); /* all or none in every lane, where it says which */

#if HAS_COORDINATES
#define SOLVED_ROOM ((MOST + 1) * (1 + NX)) /* of rows with their Jacobian */
#else
#define SOLVED_ROOM 0
#endif

/* The state of LANES motions. Counts are those since a lane was entered. */
typedef struct __attribute__((aligned(64))) {
    double y[N * LANES], own[N * LANES], z[N * LANES], next[N * LANES], k[EXPLICIT_STAGES + 1 + DENSE_STAGES][N * LANES], e[N * LANES], other[N * LANES];
    double u[(INPUTS + 1) * LANES], p[(PARAMETERS + 1) * LANES], c[(LANE_CONSTANTS + 1) * LANES];
    double t[LANES], h[LANES], end[LANES], at[LANES], stray[LANES], residual[LANES];
    double goal[LANES], final[LANES], wanted[LANES]; /* where steps end at the latest: the next and the last; the size of the next step */
    double now[LANES], stray_now[LANES]; /* the error of this step, and where it was not plain */
    double error[LANES], last[LANES]; /* of the last good step, less than zero where one was rejected since; its log2 */
    double position_violation[LANES], velocity_violation[LANES];
    double bad[LANES]; /* not zero where a lane has to be done alone */
    double strange[LANES]; /* where the series is not plain */
    double floor[(NQ + 1) * LANES]; /* a turn where an angle went round, for the tolerance */
    double guard[(GUARDS + 1) * LANES], guard_size[(GUARDS + 1) * LANES], guard_rate[(GUARDS + 1) * LANES], seen[(GUARDS + 1) * LANES];
    double violation[(CONSTRAINT_ROWS + 1) * LANES];
    double constants[LANES][LANE_CONSTANTS + 1]; /* the same for the loop of one motion */
    double a[DENSE_DEGREE + 1][N * LANES]; /* the continuous output, as powers of 2 theta - 1 */
    double values[EIGHTHS + 1][EVENTS_MOST * LANES], signs[EVENTS_MOST * LANES]; /* of events */
#if HAS_LANES_TAYLOR
    double series[(HIGHEST_ORDER + 1) * N * LANES];
    uint64_t owed[LANES], made[LANES], begun[LANES]; /* whose next step its series has to tell; whose series is new; who took a step before */
#endif
    uint64_t fresh[LANES]; /* whose motion has no slope and no step size yet */
    uint64_t good[LANES], met[LANES], moved[LANES], busy[LANES], steps[LANES], rejected[LANES], calls[LANES], spent[LANES]; /* `spent` is of the whole motion */
#if HAS_CHOICES
    uint64_t chart[LANES];
    double spare[(N * (HIGHEST_ORDER + 1) + CONSTRAINT_ROWS + GUARDS + EVENTS + SOLVED_ROOM) * LANES], spare_stray[LANES]; /* results of a chart that not all lanes are in */
#endif
#if HAS_COORDINATES && CLOSURE_ROWS
    double position_along[POSITIONS * NQ * LANES], position_back[POSITIONS * POSITIONS * LANES], inverse[POSITIONS * POSITIONS * LANES];
#endif
#if HAS_COORDINATES && SLIP_ROWS
    double velocity_along[VELOCITIES * NW * LANES], velocity_back[VELOCITIES * VELOCITIES * LANES];
#endif
#if HAS_COORDINATES
    double jacobian[SOLVED_ROOM * LANES], crossed[(MOST * MOST + 1) * LANES], square[2 * (MOST * MOST + 1) * LANES];
    uint64_t rounds[LANES]; /* that the last solution of the position constraints took */
#endif
#if HAS_INPUTS
    double knot[LANES], table[4 * INPUTS * LANES]; /* where the segment of each lane begins, and its polynomials */
    int tables, called; /* whether there are any, and a callback */
#endif
    int degree; /* of a */
    double *room; /* for the sums of the series */
    Dense dense; /* of the lane that is done alone; behind all that is loaded as vectors */
    size_t row[LANES];
    Motion motion[LANES];
} Lanes;

/* Vectors are loaded from there in one piece. */
typedef char lanes_are_aligned[offsetof(Lanes, fresh) % sizeof(Bits) == 0 ? 1 : -1];

/* Groups of lanes whose stages take turns: an operation of one need not wait for the one before, of the other. As many as the slopes of
   both leave room for in the first cache. */
#ifndef GROUPS
#define GROUPS (sizeof(((Lanes *)0)->k) <= 16384 ? 2 : 1)
#endif

static inline void store(double *to, Vector v)
{
    *(Vector *)to = v;
}

OWN Vector vector(const double *from)
{
    return *(const Vector *)from;
}

OWN Bits bits(const uint64_t *from)
{
    return *(const Bits *)from;
}

OWN Vector either(Bits which, Vector a, Vector b)
{
    return (Vector)((which & (Bits)a) | (~which & (Bits)b));
}

OWN Vector size_of(Vector v)
{
    return (Vector)((Bits)v & UINT64_C(0x7fffffffffffffff));
}

OWN Vector larger(Vector a, Vector b)
{
    return either((Bits)(a > b), a, b);
}

static inline int any(Bits which)
{
    uint64_t all = 0;
    int lane;
    for (lane = 0; lane < LANES; lane++)
        all |= which[lane];
    return all != 0;
}

/* log2 of positive numbers to 1e-12, of zero something far below, of what is not finite something far above. */
OWN Vector quick_log2(Vector x)
{
    const Bits exponent = ((Bits)x + UINT64_C(0x95f619980c433)) >> 52; /* the mantissa lies between the roots of 1/2 and 2 */
    const Vector m = (Vector)((Bits)x - ((exponent - 1023) << 52)), s = (m - 1.0) / (m + 1.0), q = s * s;
    const Vector whole = (Vector)(exponent | UINT64_C(0x4330000000000000)) - 4503599627371519.0; /* 2^52 + 1023 */
    return whole + s * 2.8853900817779268 * (1.0 + q * (1.0 / 3 + q * (0.2 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11 + q * (1.0 / 13)))))));
}

/* 2^x for |x| < 1000 to 1e-12. */
OWN Vector quick_exp2(Vector x)
{
    const Vector near = x + 6755399441055744.0, r = (x - (near - 6755399441055744.0)) * 0.6931471805599453; /* 3/2 2^52 */
    const Vector power = (Vector)(((Bits)near + 1023) << 52);
    return power * (1.0 + r * (1.0 + r * (1.0 / 2 + r * (1.0 / 6 + r * (1.0 / 24 + r * (1.0 / 120 + r * (1.0 / 720 + r * (1.0 / 5040 + r * (1.0 / 40320 + r * (1.0 / 362880 + r * (1.0 / 3628800)))))))))));
}

OWN Vector root_of(Vector v)
{
    double roots[LANES];
    int lane;
    memcpy(roots, &v, sizeof roots);
    for (lane = 0; lane < LANES; lane++)
        roots[lane] = sqrt(roots[lane]);
    memcpy(&v, roots, sizeof v);
    return v;
}

#if HAS_INPUTS
/* The polynomials of the segment that a lane is in; constants where there is no table. */
static void enter_segment(Lanes *w, int lane)
{
    const Run *const r = &w->motion[lane].run;
    const Inputs *const inputs = r->inputs;
    int i;
    if (!inputs)
        return;
    w->knot[lane] = inputs->knots ? inputs->times[r->segment] : 0.0;
    for (i = 0; i < 4 * INPUTS; i++)
        if (inputs->knots)
            w->table[i * LANES + lane] = inputs->polynomials[r->segment * INPUTS * 4 + (size_t)i];
        else
            w->table[i * LANES + lane] = i % 4 ? 0.0 : r->constant[i / 4];
}

/* u at states z; lanes whose callback fails become bad. */
static inline void feed_lanes(Lanes *w, const double *t, const double *z)
{
    const Vector since = vector(t) - vector(w->knot);
    int i, lane;
    for (i = 0; i < INPUTS; i++) {
        const double *const a = w->table + 4 * i * LANES;
        store(w->u + i * LANES, vector(a) + since * (vector(a + LANES) + since * (vector(a + 2 * LANES) + since * vector(a + 3 * LANES))));
    }
    for (lane = 0; w->called && lane < LANES; lane++) {
        Run *const r = &w->motion[lane].run;
        double y[NX];
        if (!w->busy[lane])
            continue;
        for (i = 0; i < NX; i++)
            y[i] = z[i * LANES + lane];
        if (feed(r, t[lane], y) != OK)
            w->bad[lane] = 1.0;
        for (i = 0; i < INPUTS; i++)
            w->u[i * LANES + lane] = r->fed[i];
    }
}
#endif

/* Where the next step of a motion ends at the latest. */
static inline double ahead(const Motion *m)
{
#if HAS_INPUTS
    return until(&m->run, m->times[m->s.done]);
#else
    return m->times[m->s.done];
#endif
}

/* Parameters, and what dynamics makes of them once. */
static void enter_parameters(Lanes *w, int lane)
{
    const Run *const r = &w->motion[lane].run;
    double *const c = w->constants[lane];
    int i, status = OK;
#if HAS_LANES_CONSTANTS && !HAS_CONSTANTS
    status = MODEL_precompute(r->p, c);
#endif
    for (i = 0; i < PARAMETERS; i++)
        w->p[i * LANES + lane] = r->p[i];
    for (i = 0; i < LANE_CONSTANTS; i++)
        w->c[i * LANES + lane] = status == OK ? c[i] : (double)NAN;
}

/* Signs of the functions of events as the motion has them. */
static void enter_signs(Lanes *w, int lane)
{
    const Events *const e = w->motion[lane].s.events;
    int k;
    for (k = 0; e && k < count_of(e); k++)
        w->signs[k * LANES + lane] = e->sign[k];
}

#if HAS_COORDINATES
static void enter_directions(Lanes *w, int lane, double t, const double *x);
static void leave_directions(Lanes *w, int lane);
static inline void lanes_on_chart(const Motions *all, Lanes *w, const double *t, double *z);
#endif

/* Into the lane from its motion, and back. */
static void enter_lane(const Motions *all, Lanes *w, int lane)
{
    const Motion *const m = w->motion + lane;
    const Simulation *const s = &m->s;
    int i;
    for (i = 0; i < N; i++) {
        w->y[i * LANES + lane] = s->x[i];
        w->own[i * LANES + lane] = s->slope[i];
    }
    w->t[lane] = s->t;
    w->goal[lane] = ahead(m);
    w->final[lane] = m->times[all->n - 1];
    w->wanted[lane] = s->next_step;
    w->error[lane] = s->error;
    w->spent[lane] = (uint64_t)s->steps + (uint64_t)s->rejected;
    w->position_violation[lane] = s->position_violation;
    w->velocity_violation[lane] = s->velocity_violation;
    w->last[lane] = log2(fabs(s->error));
    enter_signs(w, lane);
#if HAS_LANES_TAYLOR
    w->owed[lane] = s->expanded ? 0 : UINT64_MAX;
    w->made[lane] = 0;
    w->begun[lane] = s->steps ? UINT64_MAX : 0;
#endif
#if HAS_INPUTS
    enter_segment(w, lane);
#endif
#if HAS_COORDINATES
    enter_directions(w, lane, s->t, s->x);
#endif
#if HAS_CHOICES
    w->chart[lane] = (uint64_t)s->choice;
#endif
#if TURNING
    for (i = 0; i < TURNING; i++)
        w->floor[turning[i] * LANES + lane] = s->turns[turning[i]] != 0.0 ? turn : 0.0;
#endif
#if HAS_GUARDS
    for (i = 0; i < GUARDS; i++) {
        w->guard[i * LANES + lane] = s->guard[i];
        w->guard_size[i * LANES + lane] = s->guard_size[i];
        w->guard_rate[i * LANES + lane] = s->guard_rate[i];
    }
#endif
}

static void leave_lane(Lanes *w, int lane)
{
    Simulation *const s = &w->motion[lane].s;
    int i;
    for (i = 0; i < N; i++) {
        s->x[i] = w->y[i * LANES + lane];
        s->slope[i] = w->own[i * LANES + lane];
    }
    s->t = w->t[lane];
#if HIGHEST_ORDER
    s->expanded = starts_at(s, s->t, s->x);
#endif
    s->next_step = w->wanted[lane];
    s->error = w->error[lane];
    s->steps += (long)w->steps[lane];
    s->rejected += (long)w->rejected[lane];
    s->calls += (long)w->calls[lane];
    w->steps[lane] = w->rejected[lane] = w->calls[lane] = 0;
    s->position_violation = w->position_violation[lane];
    s->velocity_violation = w->velocity_violation[lane];
#if HAS_COORDINATES
    leave_directions(w, lane);
#endif
#if HAS_GUARDS
    for (i = 0; i < GUARDS; i++) {
        s->guard[i] = w->guard[i * LANES + lane];
        s->guard_size[i] = w->guard_size[i * LANES + lane];
        s->guard_rate[i] = w->guard_rate[i * LANES + lane];
    }
#endif
}

/* Rows at the output times that the motion has reached; OK, or the status that ends it, MORE where times are left. */
static int reached(const Motions *all, Motion *m)
{
    for (; (size_t)m->s.done < all->n && !(m->s.t < m->times[m->s.done]); m->s.done++) {
        const int status = deliver_row(&m->run, &m->rows, (size_t)m->s.done);
        if (status != OK)
            return status;
    }
    return (size_t)m->s.done < all->n ? MORE : OK;
}

/* Does a motion that was never begun get its first slope together with other lanes? */
static int starts_in_lanes(const Lanes *w, const Motion *m)
{
#if HAS_MANIFOLD
    (void)w, (void)m;
    return 0; /* invariants are asked for */
#else
#if HAS_INPUTS
    if (w->called)
        return 0;
#endif
#if HAS_COORDINATES
    if (on_coordinates(&m->run))
        return 0; /* directions are asked for */
#endif
    (void)w;
    return m->s.next_step == 0.0 && !FRAME; /* which may have to be based */
#endif
}

/* The next motion of the queue into a lane, where lanes_started begins it; those that end at once are left behind. */
static void refill(const Motions *all, const Method *method, Lanes *w, int lane, size_t *queue)
{
    Motion *const m = w->motion + lane;
    int i;
    w->busy[lane] = w->fresh[lane] = 0;
    while (*queue < all->rows && !w->busy[lane]) {
        const size_t row = (*queue)++;
        int status = begin(all, row, m, w->constants[lane]);
        if (status == OK) {
#if TURNING
            unwind(&m->s);
#endif
            status = reached(all, m);
        }
        if (status == MORE && starts_in_lanes(w, m)) {
            w->fresh[lane] = UINT64_MAX;
            status = OK;
        } else if (status == MORE)
            status = ready(&m->run, method, m->times[all->n - 1] - m->s.t);
        else if (status == OK) {
            finish(all, row, m, OK);
            continue;
        }
        if (status != OK) {
            finish(all, row, m, told(&m->run, status));
            continue;
        }
        m->run.dense = all->events ? &w->dense : NULL;
        w->busy[lane] = UINT64_MAX;
        w->row[lane] = row;
        for (i = 0; i < INPUTS; i++)
            w->u[i * LANES + lane] = m->run.u[i];
        enter_parameters(w, lane);
        enter_lane(all, w, lane);
    }
}

#if HAS_CHOICES
/* `rows` results, each lane from the function of the chart that it is in; that of the first takes `first` in the place of parameters. Where a
   chart has no such function the results are 1. */
static inline void lanes_in_charts(Lanes *w, const LanesFunction *of, int rows, const double *first, const double *t, const double *z, double *out)
{
    const Vector one = (Vector){0.0} + 1.0;
    const Bits busy = bits(w->busy);
    Vector stray = {0.0};
    int chart, i;
    for (chart = 0; chart < CHARTS; chart++) {
        const Bits here = (Bits)(bits(w->chart) == (uint64_t)chart);
        if (!any(here & busy))
            continue;
        for (i = 0; i < rows; i++)
            store(w->spare + i * LANES, one);
        memset(w->spare_stray, 0, sizeof w->spare_stray);
        if (of[chart])
            of[chart](t, z, w->u, chart ? w->p : first, w->spare, w->spare_stray);
        for (i = 0; i < rows; i++)
            store(out + i * LANES, either(here, vector(w->spare + i * LANES), vector(out + i * LANES)));
        stray = either(here, vector(w->spare_stray), stray);
    }
    store(w->stray, stray);
}
#define IN_LANES(name, w, rows, t, z, out) lanes_in_charts(w, lanes_of_##name, rows, (w)->p, t, z, out)
#else
#define IN_LANES(name, w, rows, t, z, out) LANES_##name(t, z, (w)->u, (w)->p, out, (w)->stray)
#endif

#include "runtime_lanes_enforced.h"

/* Before slopes at states z: inputs there. */
static inline void lanes_fed(Lanes *w, const double *t, const double *z)
{
#if HAS_INPUTS
    if (w->tables)
        feed_lanes(w, t, z);
#else
    (void)w, (void)t, (void)z;
#endif
}

/* And where an enforcement acts at every stage the states are moved. */
static inline void lanes_put(const Motions *all, Lanes *w, const double *t, double *z)
{
#if HAS_COORDINATES
    lanes_on_chart(all, w, t, z);
#else
    (void)all, (void)w, (void)t, (void)z;
#endif
}

/* The slope at states z, of the work too where it is `weighted`; lanes near a zero pivot become bad, and all that are not plain but where
   steps have functions of their own: then lanes_plain says it. */
static inline void slopes_fed(Lanes *w, const double *t, const double *z, int weighted, double *k)
{
#if HAS_LANES_SLOPE
    if (weighted) {
        LANES_slope(t, z, w->u, w->p, w->c, k, k + NX * LANES, w->bad);
        return;
    }
#endif
#if HAS_LANES_RATES
    LANES_rates(t, z, w->u, w->p, w->c, k, w->bad);
#else
#if HAS_CHOICES
    lanes_in_charts(w, lanes_of_dynamics, NX, LANE_CONSTANTS ? w->c : w->p, t, z, k);
#else
    LANES_dynamics(t, z, w->u, LANE_CONSTANTS ? w->c : w->p, k, w->stray);
#endif
    store(w->bad, vector(w->bad) + vector(w->stray));
#endif
#if HAS_POWER
    store(k + NX * LANES, (Vector){0.0});
#endif
#if HAS_POWER && !HAS_LANES_SLOPE
    if (weighted) {
        IN_LANES(power, w, 1, t, z, k + NX * LANES);
        store(w->bad, vector(w->bad) + vector(w->stray));
    }
#endif
    (void)weighted;
}

static inline void slopes(const Motions *all, Lanes *w, const double *t, double *z, int weighted, double *k)
{
    lanes_fed(w, t, z);
    lanes_put(all, w, t, z);
    slopes_fed(w, t, z, weighted, k);
}

/* Lanes where state z or its slope k, with the work, is not plain become bad. A stage that is not finite leaves none that is. */
static inline void lanes_plain(Lanes *w, const double *t, const double *z, const double *k)
{
#if HAS_LANES_RATES
    const Vector one = (Vector){0.0} + 1.0;
    LANES_plain(t, z, w->u, w->p, w->c, k, k + NX * LANES, w->bad);
    /* beyond all measure: angles of stages may have been too large */
    store(w->bad, vector(w->bad) + either((Bits)(vector(w->now) > 1e9), one, one - one));
#else
    (void)w, (void)t, (void)z, (void)k;
#endif
}

#if EXPLICIT_STAGES
/* For the functions of a method, each row of its weights once: z = y + h times a sum over the slopes, of the work too or
   without it, as nobody asks for it inside of a step; or h times the sum alone. */
#define SLOPE(j) vector(k + (j) * N * LANES + i)
#define INSIDE(sum)                        \
    for (i = 0; i < NX * LANES; i += LANES) \
        store(z + i, vector(y + i) + vector(h) * (sum));
#define MOVED(sum)                             \
    for (i = 0; i < MOVING * LANES; i += LANES) \
        store(z + i, vector(y + i) + vector(h) * (sum));
#define CHANGE(sum)                            \
    for (i = 0; i < MOVING * LANES; i += LANES) \
        store(z + i, vector(h) * (sum));

/* Row n of the weights: stages from y, then estimates of the error, then stages of the continuous output from y, then its powers, the first
   of them from y. */
static inline void combine(const Tableau *m, int n, const Lanes *w, double *z)
{
    m->sums(n, w->k[0], w->h, w->y, z);
}

/* The error of a step in units of the tolerance, into w->now, from one estimate in w->e or from two. */
static inline void lanes_error(const Motions *all, Lanes *w, int errors)
{
    Vector first = {0.0}, second = {0.0}, size;
    int i;
    for (i = 0; i < MOVING; i++) {
        Vector extent = larger(size_of(vector(w->y + i * LANES)), size_of(vector(w->z + i * LANES))), scale, scaled;
#if TURNING
        if (i < NQ)
            extent = larger(extent, vector(w->floor + i * LANES));
#endif
        scale = 1.0 / (all->atol + all->rtol * extent);
        scaled = vector(w->e + i * LANES) * scale;
        first += scaled * scaled;
        if (errors == 2) {
            scaled = vector(w->other + i * LANES) * scale;
            second += scaled * scaled;
        }
    }
    size = root_of((double)N * (first + 0.01 * second)); /* first / N over the root of size / N */
    store(w->now, either((Bits)(first == 0.0), first, first / size));
}

/* Slopes of stage n in all groups, two of them at a time where that is worth it. */
static inline void lanes_stage(Lanes *const *groups, int count, int n, int weighted)
{
    int g;
#if HAS_LANES_PAIRS && (HAS_LANES_SLOPE || !HAS_POWER)
    if (count == 2) {
        Lanes *const a = groups[0], *const b = groups[1];
#if HAS_LANES_SLOPE
        if (weighted) {
            LANES_slope_pair(a->at, a->z, a->u, a->p, a->c, a->k[n], a->k[n] + NX * LANES, a->bad,
                             b->at, b->z, b->u, b->p, b->c, b->k[n], b->k[n] + NX * LANES, b->bad);
            return;
        }
#endif
        LANES_rates_pair(a->at, a->z, a->u, a->p, a->c, a->k[n], a->bad, b->at, b->z, b->u, b->p, b->c, b->k[n], b->bad);
#if HAS_LANES_SLOPE
        for (g = 0; g < count; g++)
            store(groups[g]->k[n] + NX * LANES, (Vector){0.0});
#endif
        return;
    }
#endif
    for (g = 0; g < count; g++)
        slopes_fed(groups[g], groups[g]->at, groups[g]->z, weighted, groups[g]->k[n]);
}

/* One step of an explicit method in all lanes of the groups: z, next, and the error in units of the tolerance. The last slope is left for
   lanes_projected where it is `late`. */
static inline void lanes_step(const Motions *all, const Tableau *m, int late, Lanes *const *groups, int count)
{
    int g, n;
    for (g = 0; g < count; g++) {
        Lanes *const w = groups[g];
        memcpy(w->k[0], w->own, sizeof w->own);
        memset(w->bad, 0, sizeof w->bad);
        memset(w->moved, 0, sizeof w->moved);
#if !HAS_POWER
        memcpy(w->z + NX * LANES, w->y + NX * LANES, LANES * sizeof(double));
#endif
    }
    for (n = 1; n <= m->stages; n++) {
        for (g = 0; g < count; g++) {
            Lanes *const w = groups[g];
            combine(m, n - 1, w, w->z);
            store(w->at, vector(w->t) + m->c[n - 1] * vector(w->h));
            if (n + late > m->stages)
                continue;
            lanes_fed(w, w->at, w->z);
            lanes_put(all, w, w->at, w->z);
        }
        if (n + late <= m->stages)
            lanes_stage(groups, count, n, m->weighted >> n & 1);
    }
    for (g = 0; g < count; g++) {
        Lanes *const w = groups[g];
        memcpy(w->next, w->k[m->stages - late], sizeof w->next);
        memset(w->now, 0, sizeof w->now);
        if (m->errors == 0 || all->step_size > 0.0)
            continue;
        combine(m, m->stages, w, w->e);
        if (m->errors == 2)
            combine(m, m->stages + 1, w, w->other);
        lanes_error(all, w, m->errors);
    }
}
#endif

#if HAS_LANES_TAYLOR
#if HAS_INPUTS
/* Coefficients 1 to 3 of the inputs of all lanes, as inputs_along has those of one. */
static inline void lanes_inputs_along(const Lanes *w, double *rates)
{
    const Vector since = vector(w->t) - vector(w->knot);
    int i;
    for (i = 0; i < INPUTS; i++) {
        const double *const a = w->table + 4 * i * LANES;
        const Vector square = vector(a + 2 * LANES), cube = vector(a + 3 * LANES);
        store(rates + i * LANES, vector(a + LANES) + since * (2.0 * square + since * 3.0 * cube));
        store(rates + (INPUTS + i) * LANES, square + since * 3.0 * cube);
        store(rates + (2 * INPUTS + i) * LANES, cube);
    }
}
#endif

/* How long steps may be, as longest_step says it of one. */
OWN Vector lanes_longest(const Motions *all, const Lanes *w, int order)
{
    const Bits first = ~bits(w->begun);
    const Vector most = (Vector){0.0} + 600.0;
    Vector weight[N], least = most;
    int n = any(first & bits(w->busy)) ? order / 2 : order - 3, i;
    for (i = 0; i < MOVING; i++) {
        Vector extent = size_of(vector(w->y + i * LANES));
#if TURNING
        if (i < NQ)
            extent = larger(extent, vector(w->floor + i * LANES));
#endif
        weight[i] = 1.0 / (all->atol + all->rtol * extent);
    }
    for (n = n > 1 ? n : 1; n <= order; n++) {
        const double *const term = w->series + n * N * LANES;
        const uint64_t late = n < order - 3 ? 0 : UINT64_MAX;
        Vector size = {0.0}, log;
        for (i = 0; i < MOVING; i++) {
            const Vector scaled = vector(term + i * LANES) * weight[i];
            size += scaled * scaled;
        }
        log = (2.0 * (double)(order - n) - 2.7 - 0.34657359027997264 * quick_log2(size / (double)N)) / (double)n; /* ln(2) / 2 */
        log = either((Bits)(size < INFINITY), log, -most); /* where squares overflow a step is nothing */
        least = either((first | late) & (Bits)(size > 0.0) & (Bits)(log < least), log, least);
    }
    return quick_exp2(1.4426950408889634 * least);
}

#if HAS_CHOICES
/* The series of each lane in the chart that it is in, with its work of before. */
static inline void lanes_series(Lanes *w, int order, const double *rates_of_u)
{
    const Bits busy = bits(w->busy);
    int chart, i;
    for (chart = 0; chart < CHARTS; chart++) {
        const Bits here = (Bits)(bits(w->chart) == (uint64_t)chart);
        if (!any(here & busy))
            continue;
        memcpy(w->spare, w->series, (size_t)((order + 1) * N * LANES) * sizeof(double));
        lanes_of_taylor[chart](w->t, w->y, w->u, rates_of_u, w->p, w->c, order, w->spare, w->room, w->spare_stray);
        for (i = 0; i < (order + 1) * N; i++)
            store(w->series + i * LANES, either(here, vector(w->spare + i * LANES), vector(w->series + i * LANES)));
        store(w->strange, either(here, vector(w->spare_stray), vector(w->strange)));
    }
}
#endif

/* The series from all states on, where any lane has come to a new one; and there the size of the next step. */
static inline void lanes_expanded(const Motions *all, Lanes *w)
{
    const Bits owed = bits(w->owed) & bits(w->busy);
    const int order = order_of(all->rtol);
    const double *rates_of_u = NULL;
    int n;
#if HAS_INPUTS
    double __attribute__((aligned(64))) rates_here[3 * INPUTS * LANES];
#endif
    if (!any(owed))
        return;
#if HAS_INPUTS
    if (w->tables) {
        feed_lanes(w, w->t, w->y);
        lanes_inputs_along(w, rates_here);
        rates_of_u = rates_here;
    }
#endif
    memcpy(w->series + NX * LANES, w->y + NX * LANES, LANES * sizeof(double));
    for (n = 1; n <= order && !HAS_POWER; n++)
        store(w->series + (n * N + NX) * LANES, (Vector){0.0});
#if HAS_CHOICES
    lanes_series(w, order, rates_of_u);
#else
    LANES_taylor(w->t, w->y, w->u, rates_of_u, w->p, w->c, order, w->series, w->room, w->strange);
#endif
    if (!(all->step_size > 0.0))
        store(w->wanted, either(owed & (Bits)(vector(w->strange) == 0.0), lanes_longest(all, w, order), vector(w->wanted)));
    *(Bits *)w->made |= owed;
    *(Bits *)w->owed = bits(w->owed) & ~owed;
}

#if HAS_LENGTHS
/* Lanes become bad where the slope at the end differs from that of the series, as along_others has it of one. */
static inline void lanes_along_others(const Motions *all, Lanes *w)
{
    const Vector one = (Vector){0.0} + 1.0;
    Vector differ = {0.0}, speed = {0.0};
    int i;
    slopes(all, w, w->end, w->z, 0, w->other);
    for (i = 0; i < NQ; i++) {
        differ = larger(differ, size_of(vector(w->other + i * LANES) - vector(w->next + i * LANES)));
        speed = larger(speed, size_of(vector(w->next + i * LANES)));
    }
    store(w->bad, vector(w->bad) + either((Bits)(differ <= OTHER_WAY * speed), one - one, one));
}
#endif

/* Along the series to the ends of the steps. */
static inline void lanes_along(const Motions *all, Lanes *w)
{
    const Vector h = vector(w->h), square = h * h;
    const int order = order_of(all->rtol);
    int i, n;
    for (i = 0; i < N; i++) {
        const double *const term = w->series + i * LANES;
        Vector odd = {0.0}, even = {0.0}, odd_slope = {0.0}, even_slope = {0.0};
        for (n = order; n > 0; n--) {
            const Vector a = vector(term + n * N * LANES);
            if (n % 2)
                odd = odd * square + a, odd_slope = odd_slope * square + (double)n * a;
            else
                even = even * square + a, even_slope = even_slope * square + (double)n * a;
        }
        store(w->z + i * LANES, vector(term) + (h * odd + square * even));
        store(w->next + i * LANES, odd_slope + h * even_slope);
    }
    memcpy(w->bad, w->strange, sizeof w->bad);
    memset(w->moved, 0, sizeof w->moved);
    memset(w->now, 0, sizeof w->now);
#if HAS_LENGTHS
    lanes_along_others(all, w);
#endif
}

/* The series as continuous output, as taylor_dense has that of one. */
static inline void lanes_recentred(const Motions *all, Lanes *w)
{
    const int order = order_of(all->rtol);
    Vector power = (Vector){0.0} + 1.0;
    int i, k, n;
    w->degree = order > 3 ? order : 3;
    memset(w->a[3], 0, sizeof w->a[3]);
    for (n = 0; n <= order; n++, power *= 0.5 * vector(w->h))
        for (i = 0; i < NX; i++)
            store(w->a[n] + i * LANES, power * vector(w->series + (n * N + i) * LANES));
    for (k = 0; k < w->degree; k++) /* a shift by one, after Horner */
        for (n = w->degree - 1; n >= k; n--)
            for (i = 0; i < NX; i++)
                store(w->a[n] + i * LANES, vector(w->a[n] + i * LANES) + vector(w->a[n + 1] + i * LANES));
}
#endif

/* Is the slope at the end of a step made once, behind the projection? Before it that of the stage before stands for it. */
static inline int is_late(const Motions *all, const Method *method)
{
#if HAS_PROJECT && EXPLICIT_STAGES && !KINKS
    return all->enforcement == PROJECTION && !method->prepare && ((const Tableau *)method->coefficients)->late;
#else
    (void)all, (void)method;
    return 0;
#endif
}

/* Evaluations that a step takes in each lane before it is projected. */
OWN Bits stages_of(const Motions *all, const Method *method, const Lanes *w)
{
#if EXPLICIT_STAGES
    if (!method->prepare)
        return bits(w->busy) & (uint64_t)(((const Tableau *)method->coefficients)->stages - is_late(all, method));
#endif
    (void)all, (void)method;
#if HAS_LANES_TAYLOR
    return (bits(w->made) & 1) + (bits(w->busy) & HAS_LENGTHS);
#else
    return (Bits){0};
#endif
}

#if HAS_PROJECT
/* Puts z of these lanes back on the constraints. What does not converge becomes bad. Returns the lanes that were not within `close` of the
   constraints before their last step: its error is the square of that. */
OWN Bits lanes_closed(Lanes *w, Bits which, double close)
{
    double *const point = w->e, *const nearer = w->other;
    Bits active = which, trusted = active ^ active;
    Vector before = (Vector){0.0} + INFINITY;
    const Vector one = (Vector){0.0} + 1.0;
    int i, n;
    memcpy(point, w->z, sizeof w->z);
    for (n = 0; n < PROJECT_MOST && any(active); n++) {
        Vector residual;
        Bits met;
        LANES_project(w->end, point, w->u, w->p, nearer, w->stray, w->residual);
        residual = vector(w->residual);
        store(w->bad, vector(w->bad) + either(active, vector(w->stray), residual - residual));
        active &= (Bits)(vector(w->stray) == 0.0);
        for (i = 0; i < NX; i++)
            store(point + i * LANES, either(active, vector(nearer + i * LANES), vector(point + i * LANES)));
        met = (Bits)(residual <= PROJECT_TOLERANCE) | ((Bits)(residual >= 0.5 * before) & (Bits)(residual <= 1000.0 * PROJECT_TOLERANCE));
        trusted |= active & ~met & (Bits)(residual <= close);
        active &= ~(met | (Bits)(residual <= close));
        before = residual;
    }
    store(w->bad, vector(w->bad) + either(active, one, one - one)); /* not converged */
    return trusted;
}

/* The slope at z, which a projection moved where it is `moved`; lanes that came to another branch by it become bad. */
static inline void lanes_turned(const Motions *all, Lanes *w, Bits moved, Bits wanted, Vector move)
{
    const Vector one = (Vector){0.0} + 1.0;
    Vector jump = {0.0}, speed = {0.0};
    int i;
    slopes(all, w, w->end, w->z, 1, w->k[0]);
    lanes_plain(w, w->end, w->z, w->k[0]);
    for (i = 0; i < NQ; i++) {
        jump = larger(jump, size_of(vector(w->k[0] + i * LANES) - vector(w->next + i * LANES)));
        speed = larger(speed, size_of(vector(w->next + i * LANES)));
    }
    store(w->bad, vector(w->bad) + either(moved & (Bits)(jump > OTHER_BRANCH * speed) & (Bits)(jump > FAR_BEYOND * move), one, one - one));
    for (i = 0; i < N; i++)
        store(w->next + i * LANES, either(wanted, vector(w->k[0] + i * LANES), vector(w->next + i * LANES)));
    *(Bits *)w->moved += wanted & 1;
    *(Bits *)w->calls += wanted & 1;
}

/* These lanes on the constraints again, and the slope there: where that moved them, and where it is `late`, in all. */
OWN Bits lanes_projected(const Motions *all, Lanes *w, Bits which, int late, double close)
{
    const Bits trusted = lanes_closed(w, which, close);
    const Vector one = (Vector){0.0} + 1.0;
    Vector move = {0.0}, gone = {0.0}, size = {0.0};
    Bits moved = which ^ which, far;
    int i;
    for (i = 0; i < NX; i++) {
        const Vector z = vector(w->z + i * LANES);
        moved |= (Bits)(vector(w->e + i * LANES) != z);
        move = larger(move, size_of(vector(w->e + i * LANES) - z));
        gone = larger(gone, size_of(z - vector(w->y + i * LANES)));
        size = larger(size, size_of(z));
    }
    moved &= which;
    far = (Bits)(gone > 0.0) & (Bits)(move > OTHER_BRANCH * gone) & (Bits)(move > FAR_BEYOND * (all->atol + all->rtol * size));
    store(w->bad, vector(w->bad) + either(moved & far, one, one - one));
    memcpy(w->z, w->e, NX * LANES * sizeof(double)); /* lanes that are not good are not looked at any more */
    if (any(late ? which : moved))
        lanes_turned(all, w, moved, late ? which : moved, move);
    return trusted;
}
#endif

/* What constraints and guards say about z: violations, and lanes that the loop of one motion has to look at. */
static inline void lanes_looked(Lanes *w)
{
#if HAS_LANES_LOOKED
    LANES_looked(w->end, w->z, w->u, w->p, w->violation, w->seen, w->stray);
#elif HAS_CONSTRAINTS
    IN_LANES(constraints, w, CONSTRAINT_ROWS, w->end, w->z, w->violation);
    store(w->bad, vector(w->bad) + vector(w->stray));
#endif
#if HAS_GUARDS
    const Vector one = (Vector){0.0} + 1.0;
    Vector drift = {0.0}, bad;
    int i;
    for (i = 0; HAS_CONSTRAINTS && i < POSITION_ROWS; i++)
        drift = larger(drift, size_of(vector(w->violation + i * LANES)));
#if !HAS_LANES_LOOKED
    IN_LANES(guards, w, GUARDS, w->end, w->z, w->seen);
#endif
    bad = vector(w->bad) + vector(w->stray);
    for (i = 0; i < GUARDS; i++) {
        const Vector value = vector(w->seen + i * LANES), old = vector(w->guard + i * LANES), rate = vector(w->guard_rate + i * LANES);
        const Vector size = vector(w->guard_size + i * LANES), part = size_of(value) / larger(size, size_of(value));
        const Vector before = size_of(old) + 1.2 * vector(w->h) * (rate - larger(rate, rate - rate));
        const Bits near = ~(Bits)(part > 1e-6) | ((Bits)(part < 0.1) & (Bits)(drift > 1e-4 * part * part));
        const Bits crossed = (Bits)(size > 0.0) & ((Bits)(value * old < 0.0) | (Bits)(before < 0.0));
        bad += either(near | crossed, one, one - one);
    }
    store(w->bad, bad);
#endif
    (void)w;
}

#if HAS_PROJECT
/* Good lanes on the constraints, and what these say then. A step of Newton's method from within 1e-8 is trusted to end at rounding; where
   the constraints do not say so there are more. */
static inline void lanes_enforced(const Motions *all, Lanes *w, int late)
{
    const Bits trusted = lanes_projected(all, w, bits(w->good), late, HAS_CONSTRAINTS ? 1e-8 : 0.0);
    Vector most = {0.0}, size = (Vector){0.0} + 1.0;
    Bits off;
    int i;
    lanes_looked(w);
    for (i = 0; i < CONSTRAINT_ROWS; i++)
        most = larger(most, size_of(vector(w->violation + i * LANES)));
    for (i = 0; i < NX; i++)
        size = larger(size, size_of(vector(w->z + i * LANES)));
    off = trusted & ~(Bits)(most <= PROJECT_TOLERANCE * size) & (Bits)(vector(w->bad) == 0.0);
    if (!any(off))
        return;
    lanes_projected(all, w, off, 0, 0.0);
    lanes_looked(w);
}
#endif

#if HAS_GUARDS && HAS_PROJECT
/* Lanes that go by a singular position, as in is_passing: their steps are made by the loop of one motion. */
static inline void lanes_passing(Lanes *w)
{
    const Vector one = (Vector){0.0} + 1.0, zero = one - one;
    int i;
    for (i = 0; i < GUARDS; i++) {
        const Vector rate = vector(w->guard_rate + i * LANES);
        const Vector before = size_of(vector(w->guard + i * LANES)) + 1.2 * vector(w->h) * (rate - larger(rate, zero));
        const Bits passing = (Bits)(vector(w->guard_size + i * LANES) > 0.0) & (Bits)(before < 0.0);
        store(w->bad, vector(w->bad) + either(passing, one, zero));
    }
}
#endif

/* The cubics through both ends with their slopes. */
static inline void lanes_cubic(Lanes *w)
{
    int i;
    w->degree = 3;
    for (i = 0; i < NX; i++) {
        const Vector h = vector(w->h), y = vector(w->y + i * LANES), z = vector(w->z + i * LANES);
        const Vector own = vector(w->own + i * LANES), next = vector(w->next + i * LANES), rise = 0.5 * (z - y);
        store(w->a[2] + i * LANES, 0.125 * h * (next - own));
        store(w->a[3] + i * LANES, 0.125 * h * (next + own) - 0.5 * rise);
        store(w->a[0] + i * LANES, 0.5 * (y + z) - vector(w->a[2] + i * LANES));
        store(w->a[1] + i * LANES, rise - vector(w->a[3] + i * LANES));
    }
}

#if EXPLICIT_STAGES
/* By weights of the stages, some of which are made for it. */
static inline void lanes_weighted(const Motions *all, const Tableau *m, int late, Lanes *w)
{
    const int first = m->stages + m->errors;
    int n;
    memcpy(w->k[0], w->own, sizeof w->own);
    if (late)
        memcpy(w->k[m->stages], w->next, sizeof w->next);
    for (n = 0; n < m->extra; n++) {
        combine(m, first + n, w, w->e);
        store(w->at, vector(w->t) + m->c[m->stages + n] * vector(w->h));
        slopes(all, w, w->at, w->e, 0, w->k[m->stages + 1 + n]);
    }
    w->degree = m->degree;
    for (n = 0; n <= m->degree; n++)
        combine(m, first + m->extra + n, w, w->a[n]);
}
#endif

/* The continuous output in all lanes, as runtime_dense.h makes it of one. */
static inline void lanes_dense(const Motions *all, const Method *method, Lanes *w)
{
    int i, n;
#if HAS_LANES_TAYLOR
    if (method->prepare)
        lanes_recentred(all, w);
    else
#endif
#if EXPLICIT_STAGES
    if (((const Tableau *)method->coefficients)->degree)
        lanes_weighted(all, (const Tableau *)method->coefficients, is_late(all, method), w);
    else
#endif
        lanes_cubic(w);
    (void)all, (void)method;
    for (i = 0; i < NX; i++) {
        Vector off = vector(w->z + i * LANES);
        for (n = 0; n <= w->degree; n++)
            off -= vector(w->a[n] + i * LANES);
        store(w->a[0] + i * LANES, vector(w->a[0] + i * LANES) + 0.5 * off);
        store(w->a[1] + i * LANES, vector(w->a[1] + i * LANES) + 0.75 * off);
        store(w->a[3] + i * LANES, vector(w->a[3] + i * LANES) - 0.25 * off);
    }
}

/* All functions of events at a place of the step where the states are z, as values j; lanes without a value become bad. */
static inline void lanes_events(const Motions *all, Lanes *w, double place, double *z, int j)
{
    const int own = EVENTS;
    int i, k, lane;
    store(w->at, vector(w->t) + place * vector(w->h));
#if HAS_INPUTS
    if (w->tables)
        feed_lanes(w, w->at, z);
#endif
#if EVENTS && HAS_LANES_EVENTS
    IN_LANES(events, w, EVENTS, w->at, z, w->values[j]);
    store(w->bad, vector(w->bad) + vector(w->stray));
#endif
    for (lane = 0; lane < LANES && all->events->count; lane++) {
        Run *const r = &w->motion[lane].run;
        double y[NX], x[NX], g[EVENTS_MOST];
        if (!w->busy[lane])
            continue;
        for (i = 0; i < NX; i++)
            y[i] = z[i * LANES + lane];
        if (as_row(r, w->at[lane], y, x) != OK || r->s->events->call(w->at[lane], x, g, r->s->events->data))
            w->bad[lane] = 1.0;
        for (k = 0; k < all->events->count; k++)
            w->values[j][(own + k) * LANES + lane] = g[k];
    }
}

/* The same for place j of the step on its continuous output. */
static inline void lanes_values(const Motions *all, Lanes *w, int j)
{
    const double sigma = 2.0 * eighth(j) - 1.0;
    int i, k;
    for (i = 0; i < NX && j < EIGHTHS; i++) {
        Vector sum = vector(w->a[w->degree] + i * LANES);
        for (k = w->degree - 1; k >= 0; k--)
            sum = sum * sigma + vector(w->a[k] + i * LANES);
        store(w->e + i * LANES, sum);
    }
    lanes_events(all, w, eighth(j), j < EIGHTHS ? w->e : w->z, j);
}

#if EXPLICIT_STAGES
/* A continuous output from what the step has made anyway: the polynomial of degree 5 through both ends and two slopes inside. */
static inline void lanes_roughly(const Tableau *m, Lanes *w)
{
    const Vector h = vector(w->h);
    int i, n;
    w->degree = 5;
    for (i = 0; i < NX * LANES; i += LANES) {
        const Vector y = vector(w->y + i), z = vector(w->z + i), own = h * vector(w->own + i), next = h * vector(w->next + i);
        const Vector first = h * vector(w->k[m->inside[0]] + i), third = h * vector(w->k[m->inside[1]] + i);
        for (n = 0; n <= 5; n++) {
            const double *const a = m->rough + 6 * n;
            store(w->a[n] + i, (a[0] * y + a[1] * z) + (a[2] * own + a[3] * next) + (a[4] * first + a[5] * third));
        }
    }
}

/* In which lanes is some function not far from zero, as four values in a step tell? A function that they show within a factor of two, and
   straight or bent one way, keeps away from zero in between. What the cubic through both ends is off by is counted in as below. */
OWN Bits lanes_near(const Motions *all, const Tableau *m, Lanes *w)
{
    const int count = EVENTS + all->events->count;
    const double *const third = m->rough + 36, *const two = m->rough + 42, place = 1.0 / 3.0;
    const Vector h = vector(w->h);
    Bits seen = bits(w->good) ^ bits(w->good);
    int i, k;
    for (i = 0; i < NX * LANES; i += LANES) {
        const Vector y = vector(w->y + i), z = vector(w->z + i), own = h * vector(w->own + i), next = h * vector(w->next + i);
        const Vector a = h * vector(w->k[m->inside[0]] + i), b = h * vector(w->k[m->inside[1]] + i);
        store(w->e + i, (20.0 / 27.0 * y + 7.0 / 27.0 * z) + (4.0 / 27.0 * own - 2.0 / 27.0 * next));
        store(w->a[0] + i, (third[0] * y + third[1] * z) + (third[2] * own + third[3] * next) + (third[4] * a + third[5] * b));
        store(w->a[1] + i, (two[0] * y + two[1] * z) + (two[2] * own + two[3] * next) + (two[4] * a + two[5] * b));
    }
    lanes_events(all, w, place, w->e, 4);
    lanes_events(all, w, 0.0, w->y, 0);
    lanes_events(all, w, place, w->a[0], 1);
    lanes_events(all, w, 2.0 * place, w->a[1], 2);
    lanes_events(all, w, 1.0, w->z, 3);
    for (k = 0; k < count; k++) {
        const Vector sign = vector(w->signs + k * LANES);
        const Vector a = sign * vector(w->values[0] + k * LANES), b = sign * vector(w->values[1] + k * LANES);
        const Vector c = sign * vector(w->values[2] + k * LANES), d = sign * vector(w->values[3] + k * LANES);
        const Vector least = either((Bits)(a < b), a, b), most = larger(a, b), less = either((Bits)(c < d), c, d), more = larger(c, d);
        const Vector turned = size_of(d - a - 3.0 * (c - b)), wrong = 5.0 * size_of(b - sign * vector(w->values[4] + k * LANES));
        seen |= ~(Bits)(either((Bits)(least < less), least, less) > 0.5 * larger(most, more) + turned + 3.0 * wrong);
    }
    return seen & bits(w->good);
}

/* In which lanes may something happen in the step? Values on that polynomial say in none where they stay away from zero by more than what the
   cubic through both ends is off by in the middle, which is much more than it is off itself: no parabola through three of them comes
   then near zero, either, for it leaves their range by an eighth of that at most. */
OWN Bits lanes_suspect(const Motions *all, const Tableau *m, Lanes *w)
{
    const int count = EVENTS + all->events->count;
    Vector off[EVENTS_MOST];
    Bits seen = bits(w->good) ^ bits(w->good);
    int j, k;
    lanes_cubic(w);
    lanes_values(all, w, EIGHTHS / 2);
    for (k = 0; k < count; k++)
        off[k] = vector(w->values[EIGHTHS / 2] + k * LANES);
    lanes_roughly(m, w);
    for (j = 0; j <= EIGHTHS; j++)
        lanes_values(all, w, j);
    for (k = 0; k < count; k++) {
        const Vector sign = vector(w->signs + k * LANES), wrong = 4.0 * size_of(vector(w->values[EIGHTHS / 2] + k * LANES) - off[k]);
        Vector least = sign * vector(w->values[0] + k * LANES), most = least;
        for (j = 1; j <= EIGHTHS; j++) {
            const Vector value = sign * vector(w->values[j] + k * LANES);
            least = either((Bits)(value < least), value, least);
            most = larger(value, most);
            seen |= ~(Bits)(value > wrong);
        }
        seen |= ~(Bits)(least > 0.375 * most + 2.0 * wrong);
    }
    return seen & bits(w->good);
}
#endif

/* Lanes where something may happen in the step become bad: the loop of one motion looks closer. What is asked is what it asks. */
static inline void lanes_watched(const Motions *all, const Method *method, Lanes *w)
{
    const int count = EVENTS + all->events->count;
    const Vector one = (Vector){0.0} + 1.0;
    Vector bad;
    Bits suspect = bits(w->good);
    int j, k;
#if EXPLICIT_STAGES
    if (!method->prepare && ((const Tableau *)method->coefficients)->rough && !all->events->count)
        suspect = lanes_near(all, (const Tableau *)method->coefficients, w);
    if (!any(suspect))
        return;
    if (!method->prepare && ((const Tableau *)method->coefficients)->rough && !all->events->count)
        suspect = lanes_suspect(all, (const Tableau *)method->coefficients, w);
    if (!any(suspect))
        return;
#endif
    lanes_dense(all, method, w);
    for (j = 0; j <= EIGHTHS; j++)
        lanes_values(all, w, j);
    bad = vector(w->bad);
    for (k = 0; k < count; k++) {
        const Vector sign = vector(w->signs + k * LANES);
        Bits seen = (Bits)(one < 0.0);
        for (j = 0; j <= EIGHTHS; j++)
            seen |= ~(Bits)(sign * vector(w->values[j] + k * LANES) > 0.0);
        for (j = 1; j < EIGHTHS; j++) {
            const Vector before = sign * vector(w->values[j - 1] + k * LANES), here = sign * vector(w->values[j] + k * LANES);
            const Vector after = sign * vector(w->values[j + 1] + k * LANES), bend = before - 2.0 * here + after, tilt = 0.5 * (after - before);
            /* the parabola's smallest size, times its bend, which is positive */
            seen |= (Bits)(bend > 0.0) & (Bits)(size_of(tilt) <= bend) &
                (Bits)(here * bend - 0.5 * tilt * tilt < 0.2 * bend * larger(before, larger(here, after)));
        }
        bad += either(seen, one, one - one);
    }
    store(w->bad, bad);
#if EXPLICIT_STAGES
    if (!method->prepare)
        *(Bits *)w->calls += suspect & (Bits)(bad == 0.0) & (uint64_t)((const Tableau *)method->coefficients)->extra;
#endif
}

#if KINKS
/* Lanes with a kink on their way, accepted or not, are not plain. */
static inline void lanes_kinked(Lanes *w)
{
    double y[N], own[N], z[N], next[N];
    int i, lane, which;
    for (lane = 0; lane < LANES; lane++) {
        Motion *const m = w->motion + lane;
        if (!w->busy[lane] || w->bad[lane] != 0.0)
            continue;
        for (i = 0; i < N; i++) {
            y[i] = w->y[i * LANES + lane];
            own[i] = w->own[i * LANES + lane];
            z[i] = w->z[i * LANES + lane];
            next[i] = w->next[i * LANES + lane];
        }
        if (first_kink(&m->run, m->s.landed, w->t[lane], w->h[lane], y, own, z, next, &which) <= 1.0)
            w->bad[lane] = 1.0;
    }
}
#endif

/* What constraints say of good lanes is remembered. */
static inline void lanes_violated(Lanes *w, Bits good)
{
#if HAS_CONSTRAINTS
    Vector position = vector(w->position_violation), velocity = vector(w->velocity_violation);
    int i;
    for (i = 0; i < CONSTRAINT_ROWS; i++) {
        const Vector size = either(good, size_of(vector(w->violation + i * LANES)), position - position);
        if (i < POSITION_ROWS)
            position = larger(size, position);
        else
            velocity = larger(size, velocity);
    }
    store(w->position_violation, position);
    store(w->velocity_violation, velocity);
#else
    (void)w, (void)good;
#endif
}

/* Good lanes take their step. */
static inline void lanes_accept(Lanes *w)
{
    const Bits good = bits(w->good);
    int i;
#if HAS_GUARDS
    for (i = 0; i < GUARDS; i++) {
        const Vector value = vector(w->seen + i * LANES), old = vector(w->guard + i * LANES), size = vector(w->guard_size + i * LANES);
        const Vector rate = either((Bits)(value * old > 0.0), (size_of(value) - size_of(old)) / vector(w->h), old - old);
        store(w->guard_rate + i * LANES, either(good, rate, vector(w->guard_rate + i * LANES)));
        store(w->guard + i * LANES, either(good, value, old));
        store(w->guard_size + i * LANES, either(good, larger(size_of(value), size), size));
    }
#endif
    for (i = 0; i < N; i++) {
        store(w->y + i * LANES, either(good, vector(w->z + i * LANES), vector(w->y + i * LANES)));
        store(w->own + i * LANES, either(good, vector(w->next + i * LANES), vector(w->own + i * LANES)));
    }
    lanes_violated(w, good);
}

#if HAS_CHOICES || FRAME
/* Good lanes that have come to where another chart is better, or where the frame is worn out. */
OWN Bits lanes_elsewhere(Lanes *w)
{
    uint64_t __attribute__((aligned(64))) which[LANES];
    double y[N];
    int i, lane;
    for (lane = 0; lane < LANES; lane++) {
        const Run *const r = &w->motion[lane].run;
        which[lane] = 0;
        if (!w->good[lane])
            continue;
        for (i = 0; i < N; i++)
            y[i] = w->y[i * LANES + lane];
#if FRAME
        if (MODEL_frame(w->end[lane], y, r->u, r->p) < FRAME_WORN)
            which[lane] = UINT64_MAX;
#endif
#if HAS_CHOICES
        if (MODEL_chart(r->s->choice, w->end[lane], y, r->u, r->p) != r->s->choice)
            which[lane] = UINT64_MAX;
#endif
    }
    return bits(which);
}
#endif

/* Sizes of the next steps; lanes that are good have taken theirs, others but for those that have to be done alone take a shorter one.
   `met` says which these are, and which are where something is to be done: at an output time, at a knot, beyond a turn. */
static inline void lanes_sized(const Motions *all, const Method *method, Lanes *w, uint64_t *met)
{
    const double floor_of_log = -13.287712379549449; /* log2 of 1e-4 */
    const Vector now = vector(w->now), h = vector(w->h), error = vector(w->error), one = (Vector){0.0} + 1.0;
    const Bits good = bits(w->good), busy = bits(w->busy), last = (Bits)(vector(w->end) >= vector(w->goal));
    const Bits shorter = busy & ~good & (Bits)(now > 1.0) & (Bits)(vector(w->stray_now) == 0.0);
    if (!(all->step_size > 0.0) && !method->prepare) {
        const Vector log = quick_log2(now), wanted = vector(w->wanted), most = 5.0 * one, zero = one - one;
        const Vector before = either(good, method->damp * vector(w->last), zero); /* as in shrinkage; a step that is too long knows no other */
        const Vector factor = quick_exp2(method->grow * log - before) * (1.0 / method->safety);
        const Vector least = either(good, either((Bits)(error < 0.0), one, 0.1 * one), zero);
        const Vector next = h / larger(either((Bits)(factor < most), factor, most), least);
        const Bits kept = good & last & ~(Bits)(next > wanted); /* a step that was cut short says little */
        store(w->wanted, either((good & ~kept) | shorter, next, wanted));
        store(w->error, either(good, larger(now, 1e-4 * one), either(shorter, -size_of(error), error)));
        store(w->last, either(good, larger(log, floor_of_log * one), vector(w->last)));
    }
    store(w->t, either(good, vector(w->end), vector(w->t)));
#if HAS_LANES_TAYLOR
    *(Bits *)w->owed |= good;
    *(Bits *)w->begun |= good;
#endif
    *(Bits *)w->steps += good & 1;
    *(Bits *)w->rejected += shorter & 1;
    *(Bits *)w->spent += (good | shorter) & 1;
    {
        Bits there = last;
#if TURNING
        int i;
        for (i = 0; i < TURNING; i++)
            there |= (Bits)(size_of(vector(w->y + turning[i] * LANES)) > turn);
#endif
#if HAS_CHOICES || FRAME
        there |= lanes_elsewhere(w);
#endif
        *(Bits *)met = (busy & ~(good | shorter)) | (good & there);
    }
}

/* The step to come in all lanes; `halted` says which may not take one. */
static inline void lanes_begun(const Motions *all, Lanes *w, uint64_t *halted)
{
    const Vector left = vector(w->goal) - vector(w->t), most = left * (1.0 - 1e-9), wanted = vector(w->wanted); /* as in next_size */
    const Vector half = 0.5 * left, t = size_of(vector(w->t));
    Vector h = either((Bits)(wanted >= most), left, either((Bits)(wanted > 0.5 * most), half, wanted));
    Bits stopped = (Bits)(bits(w->spent) >= (all->budget > 0 ? (uint64_t)all->budget : 0));
    int lane;
    if (all->step_size > 0.0) {
        double equal[LANES];
        for (lane = 0; lane < LANES; lane++)
            equal[lane] = next_size(&w->motion[lane].s, w->goal[lane] - w->t[lane]);
        memcpy(&h, equal, sizeof h);
    }
    for (lane = 0; all->events && lane < LANES; lane++)
        if (w->busy[lane] && !has_room(w->motion[lane].s.events))
            stopped[lane] = UINT64_MAX;
    stopped |= (Bits)(h < left) & (Bits)(h < larger(16.0 * DBL_EPSILON * t, 1e-30 * size_of(vector(w->final))));
    store(w->h, h);
    store(w->end, either((Bits)(h >= left), vector(w->goal), vector(w->t) + h));
    *(Bits *)halted = stopped & bits(w->busy);
}

/* As norm has it of one, at y. */
OWN Vector lanes_norm(const Motions *all, const Lanes *w, const double *values)
{
    Vector sum = {0.0};
    int i;
    for (i = 0; i < MOVING; i++) {
        Vector extent = size_of(vector(w->y + i * LANES)), scaled;
#if TURNING
        if (i < NQ)
            extent = larger(extent, vector(w->floor + i * LANES));
#endif
        scaled = vector(values + i * LANES) / (all->atol + all->rtol * extent);
        sum += scaled * scaled;
    }
    return root_of(sum / (double)N);
}

/* First steps from y with slopes in w->k[0], as first_step has that of one. */
OWN Vector lanes_first(const Motions *all, const Method *method, Lanes *w)
{
    const Vector one = (Vector){0.0} + 1.0, tiny = 1e-6 * one, span = vector(w->final) - vector(w->t);
    const Vector size = lanes_norm(all, w, w->y), speed = lanes_norm(all, w, w->k[0]);
    Vector h = either((Bits)(size < 1e-5) | (Bits)(speed < 1e-5), tiny, 0.01 * size / speed), bend, next;
    double longest[LANES];
    int i, lane;
    h = larger(h, 64.0 * DBL_EPSILON * size_of(vector(w->t)));
    h = either((Bits)(h < span), h, span);
    for (i = 0; i < N; i++)
        store(w->z + i * LANES, vector(w->y + i * LANES) + h * vector(w->k[0] + i * LANES));
    store(w->at, vector(w->t) + h);
    slopes(all, w, w->at, w->z, 1, w->other);
    lanes_plain(w, w->at, w->z, w->other);
    for (i = 0; i < N; i++)
        store(w->e + i * LANES, vector(w->other + i * LANES) - vector(w->k[0] + i * LANES));
    bend = larger(lanes_norm(all, w, w->e) / h, speed);
    for (lane = 0; lane < LANES; lane++) /* to all digits: what one motion would start with */
        longest[lane] = w->fresh[lane] ? pow(0.01 / bend[lane], 1.0 / method->order) : 0.0;
    memcpy(&next, longest, sizeof next);
    next = either((Bits)(bend <= 1e-15), larger(tiny, 1e-3 * h), next);
    next = either((Bits)(next < 100.0 * h), next, 100.0 * h);
    return either((Bits)(next < span), next, span);
}

/* What a start knows of good lanes: slopes in w->k[0], constraints and guards as lanes_looked left them. */
static inline void lanes_entered(const Motions *all, Lanes *w, Bits good, Vector next)
{
    const Vector one = (Vector){0.0} + 1.0;
    int i;
    for (i = 0; i < N; i++)
        store(w->own + i * LANES, either(good, vector(w->k[0] + i * LANES), vector(w->own + i * LANES)));
    store(w->wanted, either(good, next, vector(w->wanted)));
    store(w->error, either(good, 1e-4 * one, vector(w->error)));
    store(w->last, either(good, -13.287712379549449 * one, vector(w->last))); /* log2 of that */
#if HAS_GUARDS
    for (i = 0; i < GUARDS; i++) {
        const Vector value = vector(w->seen + i * LANES), size = vector(w->guard_size + i * LANES);
        store(w->guard + i * LANES, either(good, value, vector(w->guard + i * LANES)));
        store(w->guard_size + i * LANES, either(good, larger(size_of(value), size), size));
    }
#endif
    lanes_violated(w, good);
    (void)all;
}

/* Begins the motion of one lane: what is left of it where the lane is `good`. */
static void lanes_begin(const Motions *all, const Method *method, Lanes *w, int lane, int good, size_t *queue)
{
    Motion *const m = w->motion + lane;
    int status;
    if (good)
        status = events_begin(&m->run);
    else
        status = ready(&m->run, method, m->times[all->n - 1] - m->s.t);
    if (status != OK) {
        finish(all, w->row[lane], m, told(&m->run, status));
        refill(all, method, w, lane, queue);
    } else if (good)
        enter_signs(w, lane);
    else
        enter_lane(all, w, lane);
}

/* Slopes and first steps of lanes with motions that were never begun; what is not plain in one is begun as one motion. */
static __attribute__((noinline)) void lanes_started(const Motions *all, const Method *method, Lanes *w, size_t *queue)
{
    const int sized = !(all->step_size > 0.0) && !method->prepare;
    int lane;
    do {
        const Bits fresh = bits(w->fresh);
        Vector next = (Vector){0.0} + all->step_size;
        Bits good;
        memset(w->bad, 0, sizeof w->bad);
        memset(w->now, 0, sizeof w->now);
        memcpy(w->z, w->y, sizeof w->z);
        memcpy(w->end, w->t, sizeof w->end);
#if KINKS /* a motion that begins at one goes on with what is behind it */
        {
            const Vector t = vector(w->t), span = vector(w->final) - t;
            store(w->at, t + 64.0 * DBL_EPSILON * larger(size_of(t), span));
        }
#else
        memcpy(w->at, w->t, sizeof w->at);
#endif
        slopes(all, w, w->at, w->y, 1, w->k[0]);
        lanes_plain(w, w->t, w->y, w->k[0]);
        lanes_looked(w);
        if (sized)
            next = lanes_first(all, method, w);
        else if (method->prepare && !(all->step_size > 0.0))
            next = vector(w->final) - vector(w->t);
        good = fresh & (Bits)(vector(w->bad) == 0.0);
        lanes_entered(all, w, good, next);
        *(Bits *)w->calls += good & (uint64_t)(1 + sized);
        memset(w->fresh, 0, sizeof w->fresh);
        for (lane = 0; lane < LANES; lane++)
            if (fresh[lane] && (!good[lane] || all->events))
                lanes_begin(all, method, w, lane, good[lane] != 0, queue);
    } while (any(bits(w->fresh)));
}

/* Ends lanes that may not go on and refills them. Returns whether any is busy. */
static int lanes_ready(const Motions *all, const Method *method, Lanes *w, size_t *queue)
{
    uint64_t *const halted = w->met, busy = 0;
    int lane;
    for (;;) {
        if (any(bits(w->fresh)))
            lanes_started(all, method, w, queue);
#if HAS_LANES_TAYLOR
        if (method->prepare)
            lanes_expanded(all, w);
#endif
        lanes_begun(all, w, halted);
        if (!any(bits(halted)))
            break;
        for (lane = 0; lane < LANES; lane++) {
            Motion *const m = w->motion + lane;
            const Simulation *const s = &m->s;
            int status;
            if (!halted[lane])
                continue;
            leave_lane(w, lane);
            if (s->events && !has_room(s->events))
                status = FULL;
            else if (s->steps + s->rejected >= all->budget)
                status = MORE;
            else
                status = told(&m->run, m->failed && m->failed_at == w->spent[lane] ? m->failed : STEP_TOO_SMALL);
            finish(all, w->row[lane], m, status);
            refill(all, method, w, lane, queue);
        }
    }
    for (lane = 0; lane < LANES; lane++)
        busy |= w->busy[lane];
    return busy != 0;
}

/* After a good step of one lane that has come to where something is to be done. */
static int arrived(const Motions *all, Lanes *w, int lane)
{
    Motion *const m = w->motion + lane;
    int status = MORE;
    leave_lane(w, lane);
#if TURNING
    unwind(&m->s);
#endif
#if FRAME
    if (rebased(&m->run, FRAME_WORN))
        enter_parameters(w, lane);
#endif
#if HAS_CHOICES
    enter(&m->run, MODEL_chart(m->s.choice, m->s.t, m->s.x, m->run.u, m->run.p));
#endif
#if HAS_INPUTS
    if ((status = behind_knot(&m->run)) != OK)
        return status;
    status = MORE;
#endif
    if (!(m->s.t < m->times[m->s.done]))
        status = reached(all, m);
    if (status == MORE)
        enter_lane(all, w, lane);
    return status;
}

#if HAS_LANES_TAYLOR
/* Makes the series of one lane for the loop of one motion, and the size of its step. */
static int prepared(const Motions *all, const Method *method, Lanes *w, int lane)
{
    Motion *const m = w->motion + lane;
    const double left = w->goal[lane] - m->s.t;
    const int status = method->prepare(&m->run);
    if (status != OK)
        return status;
    w->h[lane] = next_size(&m->s, left);
    return too_short(&m->s, w->h[lane], left, m->times[all->n - 1]) ? STEP_TOO_SMALL : OK;
}
#endif

/* Takes the step of one lane again, by the loop of one motion. */
static int alone(const Motions *all, const Method *method, Lanes *w, int lane)
{
    Motion *const m = w->motion + lane;
    int status = OK;
    leave_lane(w, lane);
    m->s.calls -= (long)stages_of(all, method, w)[lane] + (long)w->moved[lane];
#if HAS_LANES_TAYLOR
    if (method->prepare && (status = prepared(all, method, w, lane)) != OK)
        return told(&m->run, status);
#endif
    status = advance(&m->run, method, w->goal[lane], w->goal[lane] - m->s.t, w->h[lane], &m->failed);
    m->failed_at = (uint64_t)m->s.steps + (uint64_t)m->s.rejected;
#if HAS_INPUTS
    status = status == OK ? behind_knot(&m->run) : status;
#endif
    if (status != OK)
        return told(&m->run, status);
#if FRAME
    enter_parameters(w, lane);
#endif
    status = m->s.t < m->times[m->s.done] ? MORE : reached(all, m);
    if (status == MORE)
        enter_lane(all, w, lane);
    return status;
}

/* What follows the stages of a step: good lanes take it. */
static inline void lanes_settled(const Motions *all, const Method *method, Lanes *w, size_t *queue)
{
    uint64_t *const met = w->met;
    int lane;
    if (!is_late(all, method))
        lanes_plain(w, w->end, w->z, w->next);
#if KINKS
    lanes_kinked(w);
#endif
#if HAS_GUARDS && HAS_PROJECT
    if (all->enforcement == PROJECTION && IS_EXPLICIT(method))
        lanes_passing(w);
#endif
    memcpy(w->stray_now, w->bad, sizeof w->bad);
    *(Bits *)w->good = bits(w->busy) & (Bits)(vector(w->bad) == 0.0) & (Bits)(vector(w->now) <= 1.0);
    *(Bits *)w->calls += bits(w->busy) & stages_of(all, method, w);
#if HAS_PROJECT
    if (all->enforcement == PROJECTION)
        lanes_enforced(all, w, is_late(all, method));
    else
#endif
    {
#if HAS_MANIFOLD
        if (all->enforcement == INVARIANTS || all->enforcement == INVARIANTS_EUCLIDEAN)
            lanes_held(w);
#endif
        lanes_looked(w);
    }
#if HAS_COORDINATES
    lanes_worn(all, w);
#endif
    *(Bits *)w->good = bits(w->good) & (Bits)(vector(w->bad) == 0.0);
    if (all->events) {
        lanes_watched(all, method, w);
        *(Bits *)w->good = bits(w->good) & (Bits)(vector(w->bad) == 0.0);
    }
    lanes_accept(w);
#if HAS_COORDINATES
    lanes_renewed(all, w);
#endif
#if KINKS
    for (lane = 0; lane < LANES; lane++)
        if (w->good[lane])
            w->motion[lane].s.landed = 0;
#endif
    lanes_sized(all, method, w, met);
    if (!any(bits(met)))
        return;
    for (lane = 0; lane < LANES; lane++)
        if (met[lane]) {
            const int status = w->good[lane] ? arrived(all, w, lane) : alone(all, method, w, lane);
            if (status == MORE)
                continue;
            finish(all, w->row[lane], w->motion + lane, status);
            refill(all, method, w, lane, queue);
        }
}

/* One step in all lanes of the groups. */
static inline void lanes_moved(const Motions *all, const Method *method, Lanes *const *groups, int count)
{
#if HAS_LANES_TAYLOR
    int g;
    for (g = 0; g < count && method->prepare; g++)
        lanes_along(all, groups[g]);
#endif
#if EXPLICIT_STAGES
    if (!method->prepare)
        lanes_step(all, (const Tableau *)method->coefficients, is_late(all, method), groups, count);
#endif
}

static void side_by_side(const Motions *all, const Method *method, Lanes *lanes)
{
    Lanes *groups[GROUPS]; /* with motions */
    size_t queue = 0;
    int g, lane, count;
#if HAS_INPUTS
    const int called = any_calls(all);
#endif
    for (g = 0; g < (int)GROUPS; g++) {
        Lanes *const w = lanes + g;
        memset(w, 0, sizeof *w);
        w->room = (double *)(lanes + GROUPS);
#if HAS_INPUTS
        w->tables = all->inputs != NULL;
        w->called = called;
#endif
        for (lane = 0; lane < LANES; lane++)
            refill(all, method, w, lane, &queue);
    }
    for (;;) {
        for (g = count = 0; g < (int)GROUPS; g++)
            if (lanes_ready(all, method, lanes + g, &queue))
                groups[count++] = lanes + g;
        if (!count)
            return;
        lanes_moved(all, method, groups, count);
        for (g = 0; g < count; g++)
            lanes_settled(all, method, groups[g], &queue);
    }
}
#endif

#if SIDE_BY_SIDE
/* Can they go side by side? */
static int fits_lanes(const Motions *all, const Method *method)
{
    if (all->events && EVENTS && !HAS_LANES_EVENTS)
        return 0;
#if EXPLICIT_STAGES
    if (method->step == explicit_step)
        return 1;
#endif
    return HAS_LANES_TAYLOR && method->prepare;
}
#endif

/* All motions; `workspace` has room for Lanes and begins at a multiple of 64 where motions run side by side. */
static void run_all(const Motions *all, const Method *method, void *workspace)
{
#if SIDE_BY_SIDE
    if (fits_lanes(all, method)) {
        const uintptr_t place = ((uintptr_t)workspace + 63) / 64 * 64;
        side_by_side(all, method, (Lanes *)place);
        return;
    }
#endif
    (void)workspace;
    one_by_one(all, method);
}
