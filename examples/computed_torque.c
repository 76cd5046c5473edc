/* Computed torque on a four-bar: the crank follows q1 = start + 0.6 sin(2 t), from a state that is
   off it. inverse_dynamics_u gives the torque for the acceleration that is wanted, loop and all.

   Prints the largest error of q1 in the last second. Built and run by computed_torque.py. */

#include <math.h>
#include <stdio.h>

#include "four_bar.h"

#define STEP 1e-3
#define STEPS 5000
#define RATE 8.0 /* of the error, 1/s: e'' + 2 RATE e' + RATE^2 e = 0 */

static const double *const P = four_bar_defaults;

static double wanted(double t, double start, double *speed, double *acceleration)
{
    *speed = 1.2 * cos(2.0 * t);
    *acceleration = -2.4 * sin(2.0 * t);
    return start + 0.6 * sin(2.0 * t);
}

static int torque(double t, const double x[FOUR_BAR_NX], double start, double *u)
{
    double given[FOUR_BAR_NX + 1], speed, acceleration;
    const double q = wanted(t, start, &speed, &acceleration);
    int i;

    for (i = 0; i < FOUR_BAR_NX; i++)
        given[i] = x[i];
    given[FOUR_BAR_NX] =
        acceleration + 2.0 * RATE * (speed - x[3]) + RATE * RATE * (q - x[0]);
    return four_bar_inverse_dynamics_u(t, given, NULL, P, u);
}

/* the torque is held over a step, as a computer on the machine would hold it */
static int advance(double t, double x[FOUR_BAR_NX], const double *u)
{
    static const double part[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
    double k[FOUR_BAR_NX] = {0.0}, there[FOUR_BAR_NX], sum[FOUR_BAR_NX] = {0.0};
    int stage, i;

    for (stage = 0; stage < 4; stage++) {
        for (i = 0; i < FOUR_BAR_NX; i++)
            there[i] = x[i] + part[stage] * STEP * k[i];
        if (four_bar_dynamics(t + part[stage] * STEP, there, u, P, k) != FOUR_BAR_OK)
            return 1;
        for (i = 0; i < FOUR_BAR_NX; i++)
            sum[i] += weight[stage] * k[i];
    }
    for (i = 0; i < FOUR_BAR_NX; i++)
        there[i] = x[i] + STEP / 6.0 * sum[i];
    return four_bar_project(t + STEP, there, u, P, x) != FOUR_BAR_OK;
}

int main(void)
{
    const double guess[FOUR_BAR_NX] = {1.0, -0.5, 1.7, 5.0}; /* q1, q2, q3 and w, the rate of q1 */
    double x[FOUR_BAR_NX], u[FOUR_BAR_NU], speed, acceleration, start, worst = 0.0;
    int k;

    if (four_bar_project(0.0, guess, NULL, P, x) != FOUR_BAR_OK)
        return 1;
    start = x[0] - 0.2; /* the crank begins 0.2 rad ahead */
    for (k = 0; k < STEPS; k++) {
        if (torque(k * STEP, x, start, u) != FOUR_BAR_OK || advance(k * STEP, x, u))
            return 1;
        if (k >= STEPS - 1000)
            worst = fmax(worst, fabs(wanted((k + 1) * STEP, start, &speed, &acceleration) - x[0]));
    }
    printf("%.3e\n", worst);
    return 0;
}
