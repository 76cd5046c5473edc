/* Motions in the CPython extension: the compiled loop and the batch, over arrays as _many_motions.py and _one_motion.py make them.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

enum { OUTPUTS = 6 }; /* at most */

/* How a model simulates: sizes of its structures, what comes out at each output time, and its functions. */
typedef struct {
    size_t simulation, motions; /* in bytes */
    npy_intp outputs;
    npy_intp widths[OUTPUTS]; /* of what comes out: x, work and so on */
    const char *format; /* of the arguments of advance() */
    int (*advance)(void *simulation, size_t n, const double *times, const double *u, const double *p, double rtol, double atol, long budget,
        double *const *out);
    int (*batch)(const void *motions, void *workspace);
    size_t (*workspace)(void);
} Simulator;

/* Are arrays of doubles without gaps what they should be? Sets an exception where not. */
static int usable(const Simulator *s, PyArrayObject **in, PyArrayObject **out)
{
    npy_intp n, i;
    int fit;
    for (i = 0; i < 4 + s->outputs; i++) {
        PyArrayObject *array = i < 4 ? in[i] : out[i - 4];
        if ((i && PyArray_TYPE(array) != NPY_DOUBLE) || !PyArray_ISCARRAY_RO(array)) {
            PyErr_SetString(PyExc_TypeError, "advance() needs arrays of " REALS " without gaps");
            return 0;
        }
    }
    n = PyArray_SIZE(in[1]);
    fit = PyArray_NBYTES(in[0]) == (npy_intp)s->simulation && PyArray_SIZE(in[2]) == NU && PyArray_SIZE(in[3]) == NP;
    for (i = 0; i < s->outputs; i++)
        fit = fit && PyArray_SIZE(out[i]) == n * s->widths[i];
    if (!fit)
        PyErr_SetString(PyExc_ValueError, "advance() got arrays of the wrong size");
    return fit;
}

/* advance(simulation, times, u, p, rtol, atol, budget, x, work, ...): arrays without gaps. */
static PyObject *advanced(const Simulator *s, PyObject *args)
{
    PyTypeObject *const type = &PyArray_Type;
    PyArrayObject *in[4], *out[OUTPUTS];
    double *to[OUTPUTS] = {NULL}, rtol, atol;
    long budget;
    int status;
    npy_intp i;
    /* the format says how many of the outputs there are */
    if (!PyArg_ParseTuple(args, s->format, type, &in[0], type, &in[1], type, &in[2], type, &in[3], &rtol, &atol, &budget, type, &out[0], type,
            &out[1], type, &out[2], type, &out[3], type, &out[4], type, &out[5]))
        return NULL;
    if (!usable(s, in, out))
        return NULL;
    for (i = 0; i < s->outputs; i++)
        to[i] = (double *)PyArray_DATA(out[i]);
    Py_BEGIN_ALLOW_THREADS
    status = s->advance(PyArray_DATA(in[0]), (size_t)PyArray_SIZE(in[1]), (const double *)PyArray_DATA(in[1]), (const double *)PyArray_DATA(in[2]),
        (const double *)PyArray_DATA(in[3]), rtol, atol, budget, to);
    Py_END_ALLOW_THREADS
    return PyLong_FromLong(status);
}

/* simulate_batch(motions, workspace): the structure and the room of many motions. */
static PyObject *batched(const Simulator *s, PyObject *args)
{
    Py_buffer motions, workspace;
    int status = -1;
    if (!PyArg_ParseTuple(args, "y*w*", &motions, &workspace))
        return NULL;
    if (motions.len == (Py_ssize_t)s->motions && (size_t)workspace.len >= s->workspace()) {
        Py_BEGIN_ALLOW_THREADS
        status = s->batch(motions.buf, workspace.buf);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&motions);
    PyBuffer_Release(&workspace);
    if (status < 0)
        PyErr_SetString(PyExc_ValueError, "simulate_batch() got arrays of the wrong size");
    return status < 0 ? NULL : PyLong_FromLong(status);
}
