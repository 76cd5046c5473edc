/* Clocks, of which an FMU of a mechanism has none. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

fmi3Status fmi3GetIntervalDecimal(REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)references, (void)n, (void)intervals, (void)qualifiers;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetIntervalFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)references, (void)n, (void)counters, (void)resolutions, (void)qualifiers;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetShiftDecimal(REFERENCES, fmi3Float64 shifts[])
{
    (void)references, (void)n, (void)shifts;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetShiftFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetIntervalDecimal(REFERENCES, const fmi3Float64 intervals[])
{
    (void)references, (void)n, (void)intervals;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetIntervalFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetShiftDecimal(REFERENCES, const fmi3Float64 shifts[])
{
    (void)references, (void)n, (void)shifts;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetShiftFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return refused(instance, __func__, "this FMU has no clocks");
}
