/* Kinks: where forces go on to another piece, so that no step across is smooth. A step ends there, and the next one begins behind it.

   The functions `kinks` change their sign at such places. They are looked at in FOURTHS places of every step, accepted or not, along the
   cubic through both ends. Where a sign changes, steps of the method itself, shortened, lead near the place from the side where the step
   began. What is left is so short that the last slope, carried on as it changed in the step, errs by less than the tolerance: it goes across
   by no more than rounding, so that a jump is behind it, too. A step along a series has that in the place of both, the cubic and the slope.
   The step that begins there does not look for the same kink, so that a motion which is held at a jump goes on by the error control alone.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if KINKS
enum {
    FOURTHS = 4,
    FINER = 16,    /* the same along a series, whose steps are long */
    ATTEMPTS = 20, /* steps to come near a kink */
    ROUGH = 8,     /* iterations of a root that the steps of the method improve on */
    FINE = 60      /* of one that is the result */
};
static const double NEVER = 2.0;       /* more than the whole step */
static const double NEAREST = 1e-6;    /* share of a step: a kink before that is left to the error control */
static const double CLOSE = 1e-3;      /* share of the way to a kink that a step leaves at first */
static const double CLOSE_FIXED = 0.1; /* the same of a step of given size, whose error nobody knows */
static const double NEARER = 0.1, FARTHER = 8.0, FARTHEST = 0.6; /* factors of that share, and its limit */
static const double SAFE = 0.01;       /* error of what is carried on, in units of the tolerance */
static const double FAR = 0.5;         /* share of a step that is carried on at most: farther, its last slope says nothing */

/* A step from the state: its size and end, its error in units of the tolerance, how long it is from there to the kink, where it
   arrives, with which slope, and the number of the kink that it ends before, from 1 on, or 0. */
typedef struct {
    double h, end, error, left, *z, *next;
    int kink;
} Trial;

static int kinks_at(Run *r, double t, const double *y, double *g)
{
#if KINKS_BY_INPUTS
    int status;
    if (r->inputs && (status = feed(r, t, y)) != OK)
        return status;
#endif
    return MODEL_kinks(r)(t, y, r->u, r->p, g);
}

/* One of them; NaN, which has no sign, where it has no value. */
static double kink_at(Run *r, int k, double t, const double *y)
{
    double g[KINKS];
    return kinks_at(r, t, y, g) == OK ? g[k] : (double)NAN;
}

/* How a step from y to z goes: along its series where it has one, which is returned, else by the cubic through both ends. */
static int course(const Run *r, Dense *d, double t, double h, const double *y, const double *own, const double *z, const double *next)
{
#if HIGHEST_ORDER
    if (starts_at(r->s, t, y)) {
        taylor_dense(d, r->s, h);
        return 1;
    }
#endif
    (void)r, (void)t;
    cubic(d, h, y, own, z, next);
    return 0;
}

/* Between the shares a and b of a step along its course `d`, where function k has values of two signs: about where it is zero. */
static double root_along(Run *r, const Dense *d, int k, double t, double h, double a, double b, double ga, double gb)
{
    double y[N], place = b;
    int n, side = 0;
    for (n = 0; n < ROUGH; n++) { /* the end that stays counts half, so that it does not stay for ever */
        double g;
        place = n % 3 == 2 ? 0.5 * (a + b) : b - gb * (b - a) / (gb - ga);
        dense_at(d, place, y);
        g = kink_at(r, k, t + place * h, y);
        if (g * gb > 0.0) {
            ga *= side > 0 ? 0.5 : 1.0;
            b = place, gb = g, side = 1;
        } else {
            gb *= side < 0 ? 0.5 : 1.0;
            a = place, ga = g, side = -1;
        }
    }
    return place;
}

/* Between values of one sign by `apart`, the least of them at the share `middle`: where the parabola through all three says that the sign
   changes, and back again, the first of both places; NEVER where it does not. */
static double there_and_back(Run *r, const Dense *d, int k, double t, double h, double middle, double apart, double g0, double g1, double g2)
{
    double y[N], bend = g0 - 2.0 * g1 + g2, place, g;
    if (!(g0 * g1 > 0.0 && g1 * g2 > 0.0 && fabs(g1) <= fabs(g0) && fabs(g1) <= fabs(g2)) || bend == 0.0)
        return NEVER;
    place = middle + 0.5 * apart * (g0 - g2) / bend;
    dense_at(d, place, y);
    g = kink_at(r, k, t + place * h, y);
    return g * g0 < 0.0 ? root_along(r, d, k, t, h, middle - apart, place, g0, g) : NEVER;
}

/* The share of a step from y to z at which one of the functions, `which`, changes its sign first, or by rounding behind it; NEVER where none
   does. Number `but`, from 1 on, is not asked: the step begins on it; along a series it is behind its first look. */
static double first_kink(Run *r, int but, double t, double h, const double *y, const double *own, const double *z, const double *next, int *which)
{
    const double rounding = 4.0 * DBL_EPSILON * fmax(fabs(t + h), h);
    double earlier[KINKS], before[KINKS], after[KINKS], at[N], first = NEVER;
    Dense d;
    int j, k, series, looks;
    if (kinks_at(r, t, y, before) != OK)
        return NEVER;
    memcpy(earlier, before, sizeof earlier);
    series = course(r, &d, t, h, y, own, z, next);
    looks = series ? FINER : FOURTHS;
    for (j = 1; j <= looks && first == NEVER; j++) {
        const double a = (double)(j - 1) / looks, b = (double)j / looks;
        dense_at(&d, b, at);
        if (kinks_at(r, t + b * h + (j < looks ? 0.0 : rounding), j < looks ? at : z, after) != OK)
            return NEVER;
        for (k = 0; k < KINKS; k++) {
            double place = NEVER;
            if (k + 1 == but && (!series || j == 1))
                continue;
            if (before[k] * after[k] < 0.0)
                place = root_along(r, &d, k, t, h, a, b, before[k], after[k]);
            else if (series && j > 1 + (k + 1 == but))
                place = there_and_back(r, &d, k, t, h, a, b - a, earlier[k], before[k], after[k]);
            if (place < first)
                first = place, *which = k;
        }
        memcpy(earlier, before, sizeof earlier);
        memcpy(before, after, sizeof before);
    }
    return first;
}

/* The state by h behind a step, by its series, or by its last slope, which changes as it did; the kink there. */
static double behind(Run *r, const Trial *to, double h, double *z)
{
    int i;
#if HIGHEST_ORDER
    if (starts_at(r->s, r->s->t, r->s->x)) {
        double next[N];
        along(r->s->series_order, r->s->series, to->h + h, z, next);
        return kink_at(r, to->kink - 1, to->end + h, z);
    }
#endif
    for (i = 0; i < N; i++)
        z[i] = to->z[i] + h * (to->next[i] + 0.5 * h * (to->next[i] - r->s->slope[i]) / to->h);
    return kink_at(r, to->kink - 1, to->end + h, z);
}

/* How far behind a step the kink is, that way; less than nothing where it is no nearer than `most`, or by rounding behind that. */
static double carried_root(Run *r, const Trial *to, double g, double most)
{
    double z[N], a = 0.0, b = fmin(most, to->h), ga = g, gb = behind(r, to, b, z);
    int n, side = 0;
    if (!(ga * gb < 0.0) && b < most)
        gb = behind(r, to, b = most, z);
    if (!(ga * gb < 0.0))
        return ga * behind(r, to, most + 4.0 * DBL_EPSILON * fmax(fabs(to->end + most), most), z) < 0.0 ? most : -1.0;
    for (n = 0; n < FINE && b - a > DBL_EPSILON * most; n++) {
        double c = n % 4 == 3 ? 0.5 * (a + b) : b - gb * (b - a) / (gb - ga), gc;
        if (!(c > a && c < b))
            c = 0.5 * (a + b);
        gc = behind(r, to, c, z);
        if (gc * gb > 0.0) {
            ga *= side > 0 ? 0.5 : 1.0;
            b = c, gb = gc, side = 1;
        } else {
            gb *= side < 0 ? 0.5 : 1.0;
            a = c, ga = gc, side = -1;
        }
    }
    return b;
}

/* What that errs by over h, in units of the tolerance, about; a series errs by no more than over the whole step. */
static double carried_error(const Run *r, const Trial *to, double h)
{
    double bend[N];
    int i;
#if HIGHEST_ORDER
    if (starts_at(r->s, r->s->t, r->s->x))
        return 0.0;
#endif
    for (i = 0; i < N; i++)
        bend[i] = 0.5 * h * h * (to->next[i] - r->s->slope[i]) / to->h;
    return norm(r, bend, r->s->x, to->z) * h / to->h;
}

/* Where on its way from the state a step is to end. Shares of the whole step: `before` is the farthest end that is on this side of the
   kink, `beyond` the nearest on the other, `place` about where the kink is, and `off` how far before it a step is to end. */
typedef struct {
    double before, beyond, place, off;
} Search;

/* Where another kink is on the way to the one that a step ended before, and would be gone across, it is that which the step ended before. */
static void first_on_the_way(Run *r, int but, Trial *to)
{
    double before[KINKS], after[KINKS], z[N];
    int j, k, found = 0;
    if (kinks_at(r, to->end, to->z, before) != OK)
        return;
    for (j = 1; j <= FOURTHS && !found; j++) {
        const double left = to->left, way = left * (double)j / FOURTHS;
        const int own = to->kink;
        behind(r, to, way, z);
        if (kinks_at(r, to->end + way, z, after) != OK)
            return;
        for (k = 0; k < KINKS; k++)
            if (k + 1 != but && k + 1 != own && before[k] * after[k] < 0.0) {
                double place;
                to->kink = k + 1;
                place = carried_root(r, to, before[k], way);
                if (place >= 0.0 && place < to->left)
                    to->left = place, found = k + 1;
            }
        to->kink = found ? found : own;
    }
}

/* A step that ended before the kink: whether it will do. If not, the next one is to end nearer, or farther away where it erred: a stage of
   it may have been beyond. */
static int is_near(Run *r, const Trial *whole, double g, Trial *to, Search *search)
{
    const double theta = to->h / whole->h, most = (search->beyond - theta) * whole->h;
    const int fixed = r->s->step_size > 0.0;
    if (!(to->error <= 1.0))
        return !((search->off *= FARTHER) < FARTHEST);
    to->left = carried_root(r, to, g, most);
    if (to->left < 0.0 && search->beyond == 1.0 && !fixed && whole->error > 1.0) {
        to->kink = 0; /* a step that erred went across one, and nothing else says that there is any: the next step looks again */
        return 1;
    }
    to->left = to->left < 0.0 ? most : to->left;
    first_on_the_way(r, r->s->landed, to);
    if (to->left <= FAR * to->h && carried_error(r, to, to->left) <= SAFE)
        return 1;
    if (search->off > 2.0 * CLOSE && !fixed) {
        to->kink = 0; /* as near as it can come without error; the next step looks again */
        return 1;
    }
    search->before = theta;
    search->place = fmin(theta + to->left / whole->h, 0.5 * (theta + search->beyond));
    search->off *= NEARER;
    return 0;
}

/* A step that ended beyond the kink says better where it is; one that erred across it may have ended anywhere, and halves the way at most. */
static void came_beyond(Run *r, const Trial *whole, double start, double g, const Trial *to, Search *search)
{
    Simulation *const s = r->s;
    const double least = to->error <= 1.0 ? 0.0 : 0.5 * search->place;
    Dense d;
    course(r, &d, s->t, to->h, s->x, s->slope, to->z, to->next);
    search->beyond = to->h / whole->h;
    search->place = search->beyond * root_along(r, &d, to->kink - 1, s->t, to->h, 0.0, 1.0, start, g);
    search->place = fmax(search->place, least);
    if (!(search->place > search->before))
        search->place = 0.5 * (search->before + search->beyond);
}

/* Makes of a trial step one that ends just before the first kink on its way; leaves it where there is none. Where forces jump, a stage of
   such a step may be beyond: it ends the earlier then, and the next one comes nearer. Where the step `failed`, the first slope says what
   may be on its way. Returns a status. */
static int before_kink(Run *r, const Method *method, int failed, Trial *to)
{
    Simulation *const s = r->s;
    const Trial whole = *to;
    const int fixed = s->step_size > 0.0;
    Search search = {0.0, 1.0, 1.0, fixed ? CLOSE_FIXED : CLOSE};
    double start;
    int which = 0, n;
    for (n = 0; n < N && failed != OK; n++) {
        to->z[n] = s->x[n] + whole.h * s->slope[n];
        to->next[n] = s->slope[n];
    }
    search.place = first_kink(r, s->landed, s->t, whole.h, s->x, s->slope, to->z, to->next, &which);
    if (!(search.place > NEAREST && search.place <= 1.0))
        return failed;
    to->kink = which + 1;
    start = kink_at(r, which, s->t, s->x);
    for (n = 0; n < ATTEMPTS && search.beyond - search.before > 4.0 * DBL_EPSILON; n++) {
        double g;
        to->h = fmax(0.5 * (search.before + search.place), (1.0 - search.off) * search.place) * whole.h;
        to->end = s->t + to->h;
        if (method->step(r, method->coefficients, s->t, to->h, s->x, s->slope, to->z, to->next, &to->error) != OK)
            break;
        if (fixed)
            to->error = 0.0;
        g = kink_at(r, which, to->end, to->z);
        if (!(g * start > 0.0))
            came_beyond(r, &whole, start, g, to, &search);
        else if (is_near(r, &whole, g, to, &search))
            return OK;
        else if (to->kink != which + 1) { /* another one is nearer */
            which = to->kink - 1;
            start = kink_at(r, which, s->t, s->x);
        }
    }
    *to = whole; /* there was none, or it is not to be reached */
    return method->step(r, method->coefficients, s->t, to->h, s->x, s->slope, to->z, to->next, &to->error);
}

/* By how much rates of the coordinates differ `near` the place h behind a step, before it and behind it; `fast` becomes the largest of
   them. Less than nothing where they have no value. */
static double rates_apart(Run *r, const Trial *to, double h, double near, double *fast)
{
    double z[N], before[N], after[N], apart = 0.0;
    int i;
    behind(r, to, h - near, z);
    if (slope(r, to->end + (h - near), z, before) != OK)
        return -1.0;
    behind(r, to, h + near, z);
    if (slope(r, to->end + (h + near), z, after) != OK)
        return -1.0;
    for (i = 0; i < NQ; i++) {
        apart = fmax(apart, fabs(after[i] - before[i]));
        *fast = fmax(*fast, fmax(fabs(before[i]), fabs(after[i])));
    }
    return apart;
}

#if HAS_POSITIONS
/* The same of what positions are off the constraints; `large` becomes the largest coordinate, or what it moves by in the step. */
static double positions_apart(Run *r, const Trial *to, double h, double near, double *large)
{
    double z[N], before[CONSTRAINT_ROWS], after[CONSTRAINT_ROWS], apart = 0.0;
    int i;
    behind(r, to, h - near, z);
    if (MODEL_constraints(r)(to->end + (h - near), z, r->u, r->p, before) != OK)
        return -1.0;
    behind(r, to, h + near, z);
    if (MODEL_constraints(r)(to->end + (h + near), z, r->u, r->p, after) != OK)
        return -1.0;
    for (i = 0; i < NQ; i++)
        *large = fmax(*large, fabs(z[i]) + fabs(to->next[i]) * to->h);
    for (i = 0; i < POSITION_ROWS; i++)
        apart = fmax(apart, fabs(after[i] - before[i]));
    return apart;
}
#endif

typedef double Apart(Run *r, const Trial *to, double h, double near, double *size);

/* Whether something jumps at the kink that a step ended before. What only begins there is the larger the farther behind it is; a jump is as
   large nearby. */
static int jumps(Run *r, const Trial *to, Apart *measure)
{
    const double near = 4.0 * DBL_EPSILON * fmax(fabs(to->end + to->left), to->left);
    double size = 0.0;
    const double apart = measure(r, to, to->left, near, &size);
    return apart > sqrt(DBL_EPSILON) * size && apart > 0.5 * measure(r, to, to->left, 8.0 * near, &size);
}

/* Whether what constraints allow jumps there, and rates of the coordinates with it: that is a blow, and the quasi-velocities behind it are
   others. Or positions themselves, to which no motion leads. */
static int is_blow(Run *r, const Trial *to)
{
#if HAS_POSITIONS
    if (jumps(r, to, positions_apart))
        return 1;
#endif
    return jumps(r, to, rates_apart);
}

/* By h on from where a step ended, with the slope at that state `later`. Returns a status, and leaves the step where it has no value. */
static int go_on(Run *r, Trial *to, double h, double later)
{
    double z[N], next[N];
    int status;
    behind(r, to, h, z);
    if ((status = slope(r, to->end + h + later, z, next)) != OK)
        return status;
    memcpy(to->z, z, sizeof z);
    memcpy(to->next, next, sizeof next);
    to->end += h;
    to->h += h;
    return OK;
}

/* How far it is from where a step ended to behind the kink, by no more than rounding; or to `time` where that is nearer, and `later` is
   then how far across what comes next is. 0 where no change of sign is near. */
static double way_across(Run *r, double time, const Trial *to, double *later)
{
    const double start = kink_at(r, to->kink - 1, to->end, to->z), left = time - to->end;
    double z[N], more = 2.0 * DBL_EPSILON * fmax(fabs(to->end), to->left);
    int n;
    if (fabs(left - to->left) <= 4.0 * more) {
        *later = 4.0 * more;
        return left > 0.0 ? left : 0.0;
    }
    for (n = 0; n < ATTEMPTS && to->end + to->left + more < time; n++, more *= 2.0)
        if (start * behind(r, to, to->left + more, z) < 0.0)
            return to->left + more;
    return 0.0;
}

/* Where function k of the events has its new sign, between the end of a step and h behind. */
static double event_behind(Run *r, const Trial *to, int k, int sign, double h)
{
    double z[N], g[EVENTS_MOST], a = 0.0, b = h;
    int n;
    for (n = 0; n < FINE && b - a > DBL_EPSILON * b; n++) {
        const double c = 0.5 * (a + b);
        behind(r, to, c, z);
        if (events_at(r, to->end + c, z, g) == OK && sign_of(g[k], -sign) == sign)
            b = c;
        else
            a = c;
    }
    return b;
}

/* Looks for events on the way across, h long. Returns EVENT where one of them stops the motion, which has then gone as far. */
static int events_across(Run *r, double h, Trial *to)
{
    Events *const e = r->s->events;
    Inside in = {r, NULL, to->end, h, 0, OK};
    double z[N], g[EVENTS_MOST], first[EVENTS_MOST] = {0.0};
    int status;
    behind(r, to, h, z);
    status = events_at(r, to->end + h, z, g);
    for (in.k = 0; in.k < count_of(e) && status == OK; in.k++) {
        const int before = e->sign[in.k], after = sign_of(g[in.k], before);
        first[in.k] = before && after != before ? event_behind(r, to, in.k, after, h) : (double)INFINITY;
    }
    while (status == OK) {
        int k, next = 0;
        for (k = 1; k < count_of(e); k++)
            next = first[k] < first[next] ? k : next;
        if (!count_of(e) || !(first[next] <= h))
            break;
        in.k = next;
        e->sign[next] = -e->sign[next];
        if (direction_of(e, next) * e->sign[next] >= 0 && (e->t || stop_of(e, next))) {
            behind(r, to, first[next], z);
            if (e->t && e->n < e->room) /* there is, but for steps that are full of changes */
                status = recorded(&in, to->end + first[next], z);
            if (status == OK && stop_of(e, next))
                return go_on(r, to, first[next], 0.0) == OK ? EVENT : OK;
        }
        first[next] = INFINITY;
    }
    return status;
}

/* Across the kink that a step ended before. Returns JUMP where there is a blow, EVENT where an event stops the motion on the way. */
static int across_kink(Run *r, double time, Trial *to)
{
    double h, later = 0.0;
    int status;
    if (is_blow(r, to))
        return JUMP;
    h = way_across(r, time, to, &later);
    if (h > 0.0 && r->s->events && (status = events_across(r, h, to)) != OK)
        return status;
    if (h > 0.0 && go_on(r, to, h, later) == OK && later > 0.0)
        to->end = time;
    return OK;
}
#endif
