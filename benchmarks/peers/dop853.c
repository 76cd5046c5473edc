/* A plain loop of DOP853 as in the program of Hairer and Wanner: nothing but steps to the end, by the tolerance.
   STAGES, ERROR5, ERROR3 are the sums of the method over the stages k, written out; N, T_END, START and RHS(t, y, dy) the problem. */
#include <float.h>
#include <math.h>
#include <string.h>

static double scaled(const double *e, const double *y, const double *z, double rtol)
{
    double sum = 0.0;
    for (int i = 0; i < N; i++) {
        const double part = e[i] / (0.01 * rtol + rtol * fmax(fabs(y[i]), fabs(z[i])));
        sum += part * part;
    }
    return sum;
}

static double first_step(const double *y, const double *k, double rtol)
{
    double z[N], other[N], h;
    const double size = scaled(y, y, y, rtol), speed = scaled(k, y, y, rtol);
    h = size <= 1e-10 || speed <= 1e-10 ? 1e-6 : 0.01 * sqrt(size / speed);
    for (int i = 0; i < N; i++)
        z[i] = y[i] + h * k[i];
    RHS(h, z, other);
    for (int i = 0; i < N; i++)
        other[i] -= k[i];
    const double bend = fmax(sqrt(scaled(other, y, y, rtol)) / h, sqrt(speed));
    return fmin(T_END, fmin(100.0 * h, bend <= 1e-15 ? fmax(1e-6, 1e-3 * h) : pow(0.01 / bend, 0.125)));
}

static int once(double setting, double *end)
{
    const double rtol = pow(10.0, setting);
    double y[N] = START, z[N], e[N], k[13][N], t = 0.0;
    int rejected = 0;
    RHS(t, y, k[0]);
    double h = first_step(y, k[0], rtol);
    while (t < T_END) {
        const int last = t + 1.01 * h >= T_END;
        if (last)
            h = T_END - t;
        if (!(h > 16.0 * DBL_EPSILON * t))
            return 1;
        STAGES
        ERROR5
        const double five = scaled(e, y, z, rtol);
        ERROR3
        const double three = five + 0.01 * scaled(e, y, z, rtol);
        const double error = h * five / sqrt((three > 0.0 ? three : 1.0) * N);
        const double factor = fmax(0.333, fmin(6.0, 0.9 / pow(error, 0.125)));
        if (!(error <= 1.0)) {
            h *= error > 1.0 ? factor : 0.333;
            rejected = 1;
            continue;
        }
        t = last ? T_END : t + h;
        memcpy(y, z, sizeof y);
        RHS(t, y, k[0]);
        h *= rejected ? fmin(factor, 1.0) : factor;
        rejected = 0;
    }
    memcpy(end, y, sizeof y);
    return 0;
}
