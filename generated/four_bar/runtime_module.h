/* The CPython extension around the functions of a module: f(t, x, u, p=None, out=None) for one state. What is no plain array goes
   the general way, which runtime_module_batch.h has.

   Python.h stands before it, and what the model says, as macros: MODEL, its name as a string; DEFAULTS, of the parameters, or NULL; REAL, the
   name of its numbers in NumPy as a string, and REALS, of several in C; U_NAMES and P_NAMES, of inputs and parameters, for messages; and as constants NU and NP, how many inputs and parameters
   there are, and MOST_X, the most values of the place of the state.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>
#include <numpy/ufuncobject.h>

#include <fenv.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__) /* what is rarely called stays out of the way of one state at a time */
#define RARE static __attribute__((noinline, cold))
#else
#define RARE static
#endif

/* What a function returns. */
enum { OK, SINGULAR, NOT_CONVERGED, NOT_FINITE, INACCURATE = 14 };

enum { T, X, U, P, OUT, SLOTS };
static const char *const slot_names[SLOTS] = {"t", "x", "u", "p", "out"};
static PyArray_Descr *real; /* the type of plain arrays */
static PyObject *interned[SLOTS]; /* the same as Python has them: most keywords are known by their address */

enum { HAS_INPUTS = NU > 0, HAS_PARAMETERS = NP > 0 };
enum { KEPT = 8, SMALL = 256 }; /* results of a function that are kept, and values that one may have to be kept */

typedef int (*Evaluation)(double t, const double *x, const double *u, const double *p, double *out);
typedef size_t (*Evaluations)(size_t rows, const double *t, ptrdiff_t t_stride, const double *x, ptrdiff_t x_stride, const double *u,
    ptrdiff_t u_stride, const double *p, ptrdiff_t p_stride, double *out, ptrdiff_t out_stride, signed char *status);

/* One generated function. `needs` says which of t, x, u, p it reads. */
typedef struct {
    const char *name;
    Evaluation evaluate;
    Evaluations many; /* NULL where it is done one by one */
    Evaluation quick; /* with constants in place of p, computed once from the defaults; NULL where there is none */
    int (*precompute)(const double *p, double *c);
    double *constants;
    int needs[4];
    npy_intp lengths[4]; /* of t, x, u, p */
    int ndim;
    npy_intp shape[2];
    npy_intp size;
    const char *singular, *not_converged;
    const char *signature, *about;
    PyObject *batch;
    PyObject *given[KEPT]; /* the last results, to be given again once nobody else holds them */
    int turn;
} Function;

/* ---- one state */

/* The values of a plain array of n numbers, or NULL where it is anything else. */
static inline const double *plain(PyObject *object, npy_intp n)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (Py_TYPE(object) != &PyArray_Type || PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != n ||
        PyArray_DESCR(array) != real || !PyArray_CHKFLAGS(array, NPY_ARRAY_CARRAY_RO))
        return NULL;
    return (const double *)PyArray_DATA(array);
}

/* The values of slot i; 0 where they are missing or no plain array. `values` may hold what counts where none are given. */
static inline int taken(const Function *f, PyObject *object, int i, const double **values)
{
    if (object)
        return (*values = plain(object, f->lengths[i])) != NULL;
    return *values || !f->lengths[i] || (i != X && !f->needs[i]);
}

/* Do n values lie outside of the result? */
static inline int outside(const Function *f, const double *values, int i, const double *out)
{
    return !values || out >= values + f->lengths[i] || values >= out + f->size;
}

/* Which slot a keyword names; SLOTS where none. */
static inline Py_ssize_t named(PyObject *keyword)
{
    Py_ssize_t slot;
    for (slot = OUT; slot >= T; slot--) /* the usual one first */
        if (keyword == interned[slot])
            return slot;
    for (slot = 0; slot < SLOTS; slot++)
        if (PyUnicode_CompareWithASCIIString(keyword, slot_names[slot]) == 0)
            break;
    return slot;
}

/* Put keyword arguments into the slots left by the positional ones; 0 with an exception set where that fails. */
RARE int sorted(const Function *f, PyObject *const *values, Py_ssize_t positional, PyObject *keywords, PyObject **slots)
{
    Py_ssize_t k;
    if (positional > SLOTS) {
        PyErr_Format(PyExc_TypeError, "%s() takes t, x, u, p, out, but %zd arguments were given", f->name, positional);
        return 0;
    }
    for (k = 0; keywords && k < PyTuple_GET_SIZE(keywords); k++) {
        PyObject *name = PyTuple_GET_ITEM(keywords, k);
        const Py_ssize_t slot = named(name);
        if (slot == SLOTS || slot < positional || slots[slot]) {
            PyErr_Format(PyExc_TypeError, slot == SLOTS ? "%s() has no argument %R" : "%s() got argument %R twice", f->name, name);
            return 0;
        }
        if (values[k] != Py_None)
            slots[slot] = values[k];
    }
    return 1;
}

/* Sort all arguments into slots, None as if it had been left out; most calls have out as their only keyword or none. */
static inline int gather(const Function *f, PyObject *const *args, Py_ssize_t positional, PyObject *keywords, PyObject **slots)
{
    Py_ssize_t i;
    for (i = 0; i < positional && i < SLOTS; i++)
        if (args[i] != Py_None)
            slots[i] = args[i];
    if (positional <= OUT && (!keywords || (PyTuple_GET_SIZE(keywords) == 1 && PyTuple_GET_ITEM(keywords, 0) == interned[OUT]))) {
        if (keywords && args[positional] != Py_None)
            slots[OUT] = args[positional];
        return 1;
    }
    return sorted(f, args + positional, positional, keywords, slots);
}

static const char *cause(const Function *f, int status)
{
    return status == SINGULAR ? f->singular : status == NOT_CONVERGED ? f->not_converged
        : status == INACCURATE ? "inaccurate: the estimate of the error leaves no digit of the step; take more substeps, or the method rosenbrock"
        : "not finite: an argument or a result is infinite or not a number";
}

/* Raise FloatingPointError naming function, time and cause. */
RARE PyObject *fail(const Function *f, double t, int status)
{
    PyObject *time = PyFloat_FromDouble(t);
    if (time)
        PyErr_Format(PyExc_FloatingPointError, MODEL ".%s at t = %R: %s", f->name, time, cause(f, status));
    Py_XDECREF(time);
    return NULL;
}

RARE PyObject *general(const Function *f, PyObject **slots);

/* Is it a plain array of numbers, of the shape of the result? */
static inline int fits(const Function *f, PyObject *object)
{
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_NDIM(array) == f->ndim && PyArray_DESCR(array) == real && PyArray_CHKFLAGS(array, NPY_ARRAY_CARRAY) &&
        PyArray_DIM(array, 0) == f->shape[0] && (f->ndim == 1 || PyArray_DIM(array, 1) == f->shape[1]);
}

/* An array for the result. NumPy takes longer to make one than a small system to be evaluated, so the oldest of the last ones is
   used again if nobody holds it, its memory or a weak reference to it. */
static inline PyObject *fresh(Function *f)
{
    PyObject **place = &f->given[f->turn], *result = *place;
    f->turn = (f->turn + 1) % KEPT;
    if (result && Py_REFCNT(result) == 1 && fits(f, result) && !*PyObject_GET_WEAKREFS_LISTPTR(result)) {
        Py_INCREF(result);
        return result;
    }
    result = PyArray_SimpleNew(f->ndim, (npy_intp *)f->shape, NPY_DOUBLE);
    if (result && f->size <= SMALL) {
        PyObject *old = *place;
        Py_INCREF(result);
        *place = result;
        Py_XDECREF(old);
    }
    return result;
}

/* Evaluate at one state where all arguments are plain; else the general way. */
static inline PyObject *call(Function *f, PyObject *const *args, Py_ssize_t positional, PyObject *keywords)
{
    PyObject *slots[SLOTS] = {NULL}, *result;
    const double *x = NULL, *u = NULL, *p = DEFAULTS;
    double t, *out;
    int status;
    if (!gather(f, args, positional, keywords, slots))
        return NULL;
    if (slots[T] && PyFloat_CheckExact(slots[T]))
        t = (double)PyFloat_AS_DOUBLE(slots[T]);
    else if (!slots[T] || !(PyFloat_Check(slots[T]) || PyLong_CheckExact(slots[T])))
        return general(f, slots);
    else if ((t = (double)PyFloat_AsDouble(slots[T])) == -1.0 && PyErr_Occurred()) {
        PyErr_Clear(); /* an integer beyond all numbers */
        return general(f, slots);
    }
    if (!taken(f, slots[X], X, &x) || (HAS_INPUTS && !taken(f, slots[U], U, &u)) || (HAS_PARAMETERS && !taken(f, slots[P], P, &p)))
        return general(f, slots);
    if ((result = slots[OUT])) {
        if (!PyArray_Check(result) || !fits(f, result))
            return general(f, slots);
        out = (double *)PyArray_DATA((PyArrayObject *)result);
        if (!(outside(f, x, X, out) && (!HAS_INPUTS || outside(f, u, U, out)) && (!HAS_PARAMETERS || outside(f, p, P, out)))) /* that is left to NumPy */
            return general(f, slots);
        Py_INCREF(result);
    } else {
        if (!(result = fresh(f)))
            return NULL;
        out = (double *)PyArray_DATA((PyArrayObject *)result);
    }
    if (HAS_PARAMETERS && f->quick && !slots[P])
        status = f->quick(t, x, u, f->constants, out);
    else
        status = f->evaluate(t, x, u, p, out);
    if (status != OK) {
        Py_DECREF(result);
        return fail(f, t, status);
    }
    return result;
}
